#pragma once
// What is stored of the planes of a node: its dual box and its pair of bounding quadrics.
#include <span>

#include "edgetree/bounds/pair_fit.h"

namespace limn {

// In the frame of the node's parent.
struct QuadricFit {
  // As in InnerNode: the planes of the box are row_0 + u_0 row_1 + u_1 row_2 + u_2 row_3, with u in
  // [-1, 1]^3 along the axes t_1, t_2, t_3 that complete Z in any way (Sec. 3.2); the rows' lengths
  // add up to 1.
  double rows[4][4];
  PairFit pair;
};

// Never rejects.
QuadricFit unrejectable_quadric_fit();
// Holds all wedges. moments: of their planes, in the frame `own`; null for no quadrics.
QuadricFit fit_quadrics(std::span<const Wedge> wedges, const NodeFrame& frame,
                        const PlaneMoments* moments, const NodeFrame& own);

}  // namespace limn
