#pragma once
// How the children of a node are rejected and weighed for a query.
#include <optional>

#include "edgetree/forest/forest_node.h"
#include "edgetree/light/light_term.h"
#include "edgetree/lobe/ltc.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The point alone, for rejection.
struct ForestPoint {
  Vec3d p;
  double slack;  // of distances from planes, see distance_error
  // p is representable as floats, as vertices are: it may be one.
  bool may_be_vertex = false;
  const ForestPairs* pairs = nullptr;  // of the forest
};
ForestPoint point_of(const Forest& forest, const Vec3d& p);

// All that does not depend on the node.
struct ForestQuery {
  // lights, environment: null if they are not to weigh.
  // Input and query are kept.
  ForestQuery(const Forest& forest, const LightClusters* lights, const RadiancePyramid* environment,
              const EdgeQuery& query, const EdgeSamplerInput& input);
  const Forest& forest;
  ForestPoint point;
  LtcLobe lobe;
  std::optional<LightCones> lights;
  const RadiancePyramid* environment;
  float n[3];
  // A power of two that brings the scene to the size of 1: products of lengths then neither
  // overflow nor vanish, at any scale of the scene.
  float unit;
  float p[2][3];               // unit * p = p[0] + p[1], to twice the precision of a float
  bool any_direction = false;  // motion counts in any direction, not only across the line of sight
  const EdgeSamplerInput& input;
  const EdgeQuery& asked;
  std::optional<Plane> own_plane;  // of the query's own face, if any

  // How an object moves as seen from p; until another one is asked for.
  const SeenMotion& motion_of(ShapeId object) const;

 private:
  std::optional<ViewerMotion> viewer_;
  mutable ShapeId seen_;
  mutable SeenMotion motion_;
};

// Lanes (-1 or 0) of the children that may hold an edge of E(p): never 0 where one does.
Ints may_hold_candidates(const InnerNode& node, const ForestPoint& point);
Ints may_hold_candidates(const EdgeNode& node, const ForestPoint& point);
// Whether the edge in a lane is in E(p) beyond doubt: rounding could not make it seem so.
bool surely_candidate(const EdgeNode& node, int lane, const ForestPoint& point);

// What a list of outlines asks of every node.
struct ForestCone {
  ForestCone(const Forest& forest, const EdgeQuery& query, const DirectionCone& cone,
             const Lanes& lane_scale);
  ForestPoint point;
  bool at_rest;                                     // p and the directions
  int count = 0;                                    // of planes
  float planes[DirectionCone::kMostPlanes + 1][3];  // those of the cone, and the horizon
  float slack;                                      // as in DirectionCone
  float unit, p[2][3];                              // as in ForestQuery
};
// Lanes of the children that may hold an outline inside the cone and in motion: never 0 where one
// does.
Ints may_hold_outlines(const InnerNode& node, const ForestCone& cone);
Ints may_hold_outlines(const EdgeNode& node, const ForestCone& cone);

// The weight of a child is length * rest. Both are not negative, and the product is 0 only where no
// edge can contribute.
struct ChildWeights {
  Floats length;  // of the silhouettes that each child should hold, over the squared radius
  Floats rest;    // speed, distance, lobe and light; 0 where the child is rejected
  Floats product() const;
};
// doubt, if asked for: about how many times its `rest` a child may weigh at most, since the lobe
// and the distance change over its box; below some hundreds.
ChildWeights weigh_children(const InnerNode& node, const ForestQuery& query, bool soft,
                            Floats* doubt = nullptr);
// `length` alone, for all children together and over the squared radius that `inverse_radius`
// stands for.
float length_below(const InnerNode& node, const ForestPoint& point, bool soft,
                   float inverse_radius);
float length_below(const EdgeNode& node, const ForestPoint& point, float inverse_radius);

// Weights of edges: not negative, 0 only where the edge cannot contribute, and of the query's own.
Floats weigh_edges(const EdgeNode& node, const ForestQuery& query);

}  // namespace limn
