#pragma once
// What a set of edges looks like in the space of planes: the dual box of a child.
#include <array>
#include <cstdint>
#include <span>

#include "edgetree/bounds/forest_config.h"
#include "edgetree/bounds/quadric_pair.h"
#include "limn/edgetree/edges.h"

namespace limn {

// An edge as the build sees it.
struct Wedge {
  std::array<Plane, 2> planes;  // of its faces; both the same if only one matters
  std::array<Vec3d, 2> ends;
  double length = 0;
  double angle = 0;  // exterior dihedral angle
  double speed = 0;  // what ObjectMotion leaves: mean of the two ends, lanes added up
  EdgeId edge;
};

// The frame in which a node's children are described: x = ((p - center) * inverse_radius, 1).
struct NodeFrame {
  Vec3d center;  // representable as floats, as is the inverse radius
  double inverse_radius = 1;
};

// See InnerNode for the meaning of rows and cover.
struct DualFit {
  double rows[4][4];
  double cover[3];  // times radius^2
  PairFit pair;
};

// Never rejects. cover: what a random plane crosses.
DualFit unrejectable_fit(double cover);
// Holds all planes of all wedges. In double precision: rounding to float moves rows by a relative
// 2^-24. own: the frame of the wedges themselves, for a pair of quadrics, too; null for none.
DualFit fit_dual(std::span<const Wedge> wedges, const NodeFrame& frame, const ForestConfig& config,
                 const NodeFrame* own = nullptr);
// The segment between the planes of one edge: rows 0 and 1.
DualFit fit_edge(const Wedge& wedge, const NodeFrame& frame);

}  // namespace limn
