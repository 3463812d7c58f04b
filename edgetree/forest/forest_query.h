#pragma once
// Rejection and weights of a node's children for a query.
#include <optional>

#include "edgetree/forest/forest_node.h"
#include "edgetree/light/light_term.h"
#include "edgetree/lobe/ltc.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The query's point, sufficient for rejection.
struct ForestPoint {
  Vec3d p;
  double slack;  // error of distances from planes, see distance_error
  // True if p is representable in floats and may coincide with a vertex.
  bool may_be_vertex = false;
};
ForestPoint point_of(const Forest& forest, const Vec3d& p);

// Query data that do not depend on the node.
// True if p and the directions there are static.
bool is_at_rest(const EdgeQuery& query, const Lanes& lane_scale);

struct ForestQuery {
  // lights, environment: null if not used as weights. Input and query must outlive this
  // object.
  ForestQuery(const Forest& forest, const LightClusters* lights, const RadiancePyramid* environment,
              const EdgeQuery& query, const EdgeSamplerInput& input);
  const Forest& forest;
  ForestPoint point;
  LtcLobe lobe;
  std::optional<LightCones> lights;
  const RadiancePyramid* environment;
  float n[3];
  // A power of two that scales the scene to about 1, so that products of lengths neither overflow
  // nor underflow.
  float unit;
  float p[2][3];               // unit * p = p[0] + p[1], a sum of two floats
  bool any_direction = false;  // speed in any direction counts, not only across the line of sight
  const EdgeSamplerInput& input;
  const EdgeQuery& source;
  bool at_rest;
  std::optional<Plane> own_plane;  // plane of the query's own face, if any

  // One of Forest::motions as seen from p; valid until the next call.
  const SeenMotion& seen(uint32_t motion) const;

 private:
  std::optional<ViewerMotion> viewer_;
  mutable uint32_t motion_ = UINT32_MAX;  // of seen_; none so far
  mutable SeenMotion seen_;
};

// Mask (-1 or 0) of children that may hold an edge of E(p): conservative.
Ints may_hold_candidates(const InnerNode& node, const ForestPoint& point);
Ints may_hold_candidates(const EdgeNode& node, const ForestPoint& point);
// True if the edge is in E(p) beyond rounding errors.
bool surely_candidate(const EdgeNode& node, int lane, const ForestPoint& point);

// Test data for listing outlines.
struct ForestCone {
  ForestCone(const Forest& forest, const EdgeQuery& query, const DirectionCone& cone,
             const Lanes& lane_scale);
  ForestPoint point;
  bool at_rest;                                     // p and the directions are static
  int count = 0;                                    // of planes
  float planes[DirectionCone::kMostPlanes + 1][3];  // planes of the cone, and the horizon
  float slack;                                      // as in DirectionCone
  float unit, p[2][3];                              // as in ForestQuery
};
// Mask of children that may hold a moving outline inside of the cone:
// conservative.
Ints may_hold_outlines(const InnerNode& node, const ForestCone& cone);
Ints may_hold_outlines(const EdgeNode& node, const ForestCone& cone);

// The weight of a child is length * rest; both are >= 0, and the product is 0 only if no edge can
// contribute.
struct ChildWeights {
  Floats length;  // expected length of silhouettes, over the squared radius
  Floats rest;    // speed, distance, lobe and light; 0 if rejected
  Floats product() const;
};
// uncertainty (optional): uncertainty, about the factor by which `rest` may be too small, since
// lobe and distance vary over the box; below some hundreds.
ChildWeights weigh_children(const InnerNode& node, const ForestQuery& query, bool soft,
                            Floats* uncertainty = nullptr);
// Total expected length over all children, over the squared radius given by
// `inverse_radius`.
float length_below(const InnerNode& node, const ForestPoint& point, bool soft,
                   float inverse_radius);
float length_below(const EdgeNode& node, const ForestPoint& point, float inverse_radius);

// Weights of edges: >= 0, and 0 only if the edge cannot contribute or belongs to the query's face.
Floats weigh_edges(const EdgeNode& node, const ForestQuery& query);

}  // namespace limn
