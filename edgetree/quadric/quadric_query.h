#pragma once
// Rejection and weights of a node's children in the paper's forest.
#include "edgetree/lobe/ltc.h"
#include "edgetree/quadric/polygon_light.h"
#include "edgetree/quadric/quadric_node.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The query's point, sufficient for rejection.
struct QuadricPoint {
  QuadricPoint(const QuadricForest& forest, const Vec3d& p);
  Vec3d p;
  double slack;  // error of distances from planes, see distance_error
};

// Query data that do not depend on the node.
struct QuadricQuery {
  // lights: null if not used as weights.
  QuadricQuery(const QuadricForest& forest, const PolygonLights* lights, const EdgeQuery& query);
  const EdgeQuery& query;
  QuadricPoint point;
  LtcLobe lobe;
  const PolygonLights* lights;
  double base;  // luminance from any direction
  double unit;  // a power of two that scales the scene to about 1
};

// Mask (-1 or 0) of children that may hold an edge of E(p): conservative.
Longs may_hold_candidates(const QuadricForest& forest, NodeId node, const QuadricPoint& point);

// Importances I = L_w / H^2 * (mean of the lobe over the box's solid angle) without lights, times
// the scene's unit: comparable over all nodes. 0 only if nothing can contribute.
void weigh_children(const QuadricForest& forest, NodeId node, const QuadricQuery& query,
                    double (&weights)[kQuadricWidth]);
// Importances of the edges of a leaf, after the exact test.
void weigh_edges(const EdgeSamplerInput& input, const QuadricLeaf& leaf, const QuadricQuery& query,
                 double (&weights)[kQuadricWidth]);

}  // namespace limn
