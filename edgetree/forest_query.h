#pragma once
// How the four children of a node are rejected and weighed for a query.
#include <optional>

#include "forest_node.h"
#include "light_term.h"
#include "limn/edgetree/edge_forest.h"
#include "ltc.h"

namespace limn {

// The point alone, for rejection.
struct ForestPoint {
  Vec3d p;
  double slack;  // of distances from planes, see distance_error
};
ForestPoint point_of(const Forest& forest, const Vec3d& p);

// All that does not depend on the node.
struct ForestQuery {
  // lights, environment: null if they are not to weigh.
  ForestQuery(const Forest& forest, const LightClusters* lights, const RadiancePyramid* environment,
              const EdgeQuery& query, const Lanes& lane_scale);
  ForestPoint point;
  LtcLobe lobe;
  std::optional<LightCones> lights;
  const RadiancePyramid* environment;
  float n[3];
  float speed;  // of p
};

// Lanes (-1 or 0) of the children that may hold an edge of E(p): never 0 where one does.
Int4 may_hold_candidates(const ForestNode& node, const ForestPoint& point);

// Weights of the children, not negative; 0 only where no edge can contribute.
Float4 weigh_children(const ForestNode& node, const ForestQuery& query, bool soft);

}  // namespace limn
