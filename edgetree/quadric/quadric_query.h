#pragma once
// How the children of a node of the paper's forest are rejected and weighed for a query.
#include "edgetree/lobe/ltc.h"
#include "edgetree/quadric/polygon_light.h"
#include "edgetree/quadric/quadric_node.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// The point alone, for rejection.
struct QuadricPoint {
  QuadricPoint(const QuadricForest& forest, const Vec3d& p);
  Vec3d p;
  double slack;  // of distances from planes, see distance_error
};

// All that does not depend on the node.
struct QuadricQuery {
  // lights: null if they are not to weigh.
  QuadricQuery(const QuadricForest& forest, const PolygonLights* lights, const EdgeQuery& query);
  const EdgeQuery& query;
  QuadricPoint point;
  LtcLobe lobe;
  const PolygonLights* lights;
  double base;  // luminance that counts everywhere
  double unit;  // a power of two that brings the scene to the size of 1
};

// Lanes (-1 or 0) of the children that may hold an edge of E(p): never 0 where one does.
Longs may_hold_candidates(const QuadricForest& forest, NodeId node, const QuadricPoint& point);

// Importances I = L_w / H^2 * (mean of the lobe over the box's solid angle), lights apart, times
// the scene's unit: comparable over all nodes. 0 where nothing can contribute, else positive.
void weigh_children(const QuadricForest& forest, NodeId node, const QuadricQuery& query,
                    double (&weights)[kQuadricWidth]);
// The same for the edges of a leaf, after the exact test.
void weigh_edges(const EdgeSamplerInput& input, const QuadricLeaf& leaf, const QuadricQuery& query,
                 double (&weights)[kQuadricWidth]);

}  // namespace limn
