#pragma once
// Dual boxes: bounds of a set of edges in the space of planes.
#include <array>
#include <span>

#include "edgetree/bounds/forest_config.h"
#include "limn/edgetree/edges.h"

namespace limn {

// An edge as input to the build.
struct Wedge {
  std::array<Plane, 2> planes;  // of its faces; equal if only one matters
  std::array<Vec3d, 2> ends;
  double length = 0;
  double angle = 0;  // exterior dihedral angle
  double speed = 0;  // residual of ObjectMotion: mean of both ends, sum over lanes
  double fold = 1;   // weight where p sees both faces, over that as a silhouette
  EdgeId edge;
};

// The frame of a node's children: x = ((p - center) * inverse_radius, 1).
struct NodeFrame {
  Vec3d center;  // exactly representable as floats, as is the inverse radius
  double inverse_radius = 1;
};

// See InnerNode for the meaning of rows and cover.
struct DualFit {
  double rows[4][4];
  double cover[3];  // times radius^2
};

// A fit that never rejects. cover: the length that a random plane crosses.
DualFit unrejectable_fit(double cover);
// A box that holds all planes of all wedges, in double precision; rounding to float moves rows by a
// relative 2^-24.
DualFit fit_dual(std::span<const Wedge> wedges, const NodeFrame& frame, const ForestConfig& config);
// The segment between the planes of an edge: rows 0 and 1.
DualFit fit_edge(const Wedge& wedge, const NodeFrame& frame);

}  // namespace limn
