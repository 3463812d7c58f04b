#pragma once
// Fits of a node's planes: dual box and pair of bounding quadrics.
#include <span>

#include "edgetree/bounds/pair_fit.h"

namespace limn {

// A fit in the frame of the node's parent.
struct QuadricFit {
  // As in InnerNode: planes of the box are row_0 + u_0 row_1 + u_1 row_2 + u_2 row_3 with u in
  // [-1, 1]^3, along arbitrary axes t_1, t_2, t_3 that complete Z (Sec. 3.2). Row lengths sum to
  // 1.
  double rows[4][4];
  PairFit pair;
};

// A fit that never rejects.
QuadricFit unrejectable_quadric_fit();
// A fit that holds all wedges. moments: of their planes, in the frame `own`; null: no quadrics.
QuadricFit fit_quadrics(std::span<const Wedge> wedges, const NodeFrame& frame,
                        const PlaneMoments* moments, const NodeFrame& own);

}  // namespace limn
