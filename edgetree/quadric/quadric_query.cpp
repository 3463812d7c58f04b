// Rejection and weights of a node's children in the paper's forest.
#include "edgetree/quadric/quadric_query.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Lower bound of the squared distance of a box, as a share of its squared radius. Not tuned.
constexpr double kNear = 0.25;

// p in the frame of a node.
struct FramePoint {
  double x[3];
  FramePoint(const QuadricNode& node, const Vec3d& p) {
    for (int k = 0; k < 3; ++k) x[k] = (p[k] - node.origin[k]) * node.inverse_radius;
  }
};

// Rows were rounded to floats, with a relative error of 2^-24 per entry, so all rows together are
// off by 2^-24; the rounding of doubles, here and in the fit (kMinSeparation), is far below as much
// again. A plane of the box is at most as long as the rows together, and a unit plane is longer
// than 1, so distance_error applies unscaled.
QueryPlanes planes_of(const QuadricNode& node, const FramePoint& at, double slack) {
  QueryPlanes planes;
  for (int i = 0; i < 4; ++i)
    planes.g[i] = widen(node.rows[i][0]) * at.x[0] + widen(node.rows[i][1]) * at.x[1] +
                  widen(node.rows[i][2]) * at.x[2] + widen(node.rows[i][3]);
  const double size = 1 + std::fabs(at.x[0]) + std::fabs(at.x[1]) + std::fabs(at.x[2]);
  planes.error = 0x1.0p-23 * size + 2 * slack * node.inverse_radius;
  return planes;
}

// Boxes of up to four children or edges: centers minus p and half extents, in one unit.
struct Boxes {
  Doubles d[3], half[3];
};

// Weights of the children that are alive and not below the horizon: base * mean of the lobe / H^2.
// unit: converts scene lengths to lengths of the boxes.
void weigh_boxes(const Boxes& boxes, Longs alive, const QuadricQuery& query, double unit,
                 const Doubles& length, double (&weights)[kQuadricWidth]) {
  Floats3 center{}, half{};
  Floats* centers[3] = {&center.x, &center.y, &center.z};
  Floats* halves[3] = {&half.x, &half.y, &half.z};
  for (int k = 0; k < 3; ++k)
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      (*centers[k])[lane] = static_cast<float>(boxes.d[k][lane]);
      (*halves[k])[lane] = static_cast<float>(boxes.half[k][lane]);
    }
  const Floats mean = query.lobe.mean_over_boxes(center, half);
  for (int lane = 0; lane < kQuadricWidth; ++lane) {
    weights[lane] = 0;
    if (alive[lane] == 0 || !(mean[lane] > 0)) continue;
    const Vec3d d{boxes.d[0][lane], boxes.d[1][lane], boxes.d[2][lane]};
    const Vec3d h{boxes.half[0][lane], boxes.half[1][lane], boxes.half[2][lane]};
    double light = query.base * mean[lane];
    if (query.lights) light += query.lights->mean_over_box(query.lobe, query.point.p, d, h, unit);
    const double distance2 = std::max(length_squared(d), kNear * length_squared(h));
    // No underflow: distances in this unit are below 2^400.
    weights[lane] = distance2 > 0 ? length[lane] * light / distance2 : 0;
  }
}

}  // namespace

QuadricPoint::QuadricPoint(const QuadricForest& forest, const Vec3d& at) : p(at) {
  EdgeMesh farthest;
  farthest.extent = forest.extent;
  slack = distance_error(farthest, p);
}

QuadricQuery::QuadricQuery(const QuadricForest& forest, const PolygonLights* polygons,
                           const EdgeQuery& edge_query)
    : query(edge_query),
      point(forest, edge_query.p),
      lobe(edge_query.lobe, edge_query.n, edge_query.wi),
      lights(polygons),
      base(polygons ? polygons->base(edge_query.p) : 1) {
  const Vec3d& p = query.p;
  const double size = forest.extent + std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z);
  int exponent = 0;
  std::frexp(size, &exponent);
  unit = std::ldexp(1.0, -exponent);
}

Longs may_hold_candidates(const QuadricForest& forest, NodeId id, const QuadricPoint& point) {
  const QuadricNode& node = forest.nodes[id];
  Longs alive;
  for (int lane = 0; lane < kQuadricWidth; ++lane) alive[lane] = -(node.child[lane] != kNoChild);
  if (rejects_none(node.group)) return alive;
  const QueryPlanes planes = planes_of(node, FramePoint(node, point.p), point.slack);
  if (node.group == ForestGroup::kFront) {
    const Doubles reach = abs(planes.g[1]) + abs(planes.g[2]) + abs(planes.g[3]) + planes.error;
    return alive & (planes.g[0] + reach >= 0);
  }
  alive &= meet_box(planes);
  if (!forest.pairs.empty() && any(alive)) alive &= meet_pair(forest.pairs[id], planes);
  return alive;
}

void weigh_children(const QuadricForest& forest, NodeId id, const QuadricQuery& query,
                    double (&weights)[kQuadricWidth]) {
  const Longs alive = may_hold_candidates(forest, id, query.point);
  if (!any(alive)) {
    std::fill_n(weights, kQuadricWidth, 0.0);
    return;
  }
  const QuadricNode& node = forest.nodes[id];
  const FramePoint at(node, query.point.p);
  Boxes boxes;
  for (int k = 0; k < 3; ++k) {
    boxes.d[k] = widen(node.center[k]) - at.x[k];
    boxes.half[k] = widen(node.half[k]);
  }
  weigh_boxes(boxes, alive, query, node.inverse_radius, widen(node.weight), weights);
  for (double& weight : weights) weight *= node.inverse_radius / query.unit;
}

void weigh_edges(const EdgeSamplerInput& input, const QuadricLeaf& leaf, const QuadricQuery& query,
                 double (&weights)[kQuadricWidth]) {
  const EdgeMesh& mesh = input.object(leaf.object);
  Boxes boxes{};
  Doubles lengths{};
  Longs alive{};
  for (int lane = 0; lane < kQuadricWidth; ++lane) {
    if (leaf.edge[lane] == kNoChild) continue;
    const EdgeId edge(static_cast<uint32_t>(leaf.edge[lane]));
    if (!is_candidate(mesh, edge, query.point.p) ||
        is_own_edge(input, query.query, {leaf.object, edge}))
      continue;
    alive[lane] = -1;
    const auto [i, j] = mesh.edge(edge).vertices;
    const Vec3d a = (mesh.position(i) - query.point.p) * query.unit;
    const Vec3d b = (mesh.position(j) - query.point.p) * query.unit;
    for (int k = 0; k < 3; ++k) {
      boxes.d[k][lane] = 0.5 * (a[k] + b[k]);
      boxes.half[k][lane] = 0.5 * std::fabs(a[k] - b[k]);
    }
    lengths[lane] = length(b - a);
  }
  if (any(alive)) {
    weigh_boxes(boxes, alive, query, query.unit, lengths, weights);
  } else {
    std::fill_n(weights, kQuadricWidth, 0.0);
  }
}

}  // namespace limn
