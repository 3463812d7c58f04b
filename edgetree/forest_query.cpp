#include "forest_query.h"

#include <cmath>
#include <limits>

namespace limn {
namespace {

// A plane near a corner of a dual box is taken to meet this share of what one in the middle does,
// at least.
constexpr float kShallow = 0.1f;
// Points in or near a box see its edges at this share of its squared radius at least.
constexpr float kNear = 0.25f;
// Radiance of objects as a share of the mean of the environment that lights them.
constexpr float kScattered = 1.0f;

// p in the frame of a node, and what rounding can add to row . x of all rows together: of the
// entries of rows and of x by 2^-24 each, four roundings in a product and two in sums; rows have
// unit length together.
struct FramePoint {
  float x[3];
  float error;
  float size;  // sum of |x| and 1
};
FramePoint to_frame(const ForestNode& node, const ForestPoint& point) {
  FramePoint result;
  const double inverse = 1 / static_cast<double>(node.radius);
  result.size = 1;
  for (int k = 0; k < 3; ++k) {
    result.x[k] = static_cast<float>((point.p[k] - node.center[k]) * inverse);
    result.size += std::fabs(result.x[k]);
  }
  result.error = 12 * 0x1.0p-24f * result.size + static_cast<float>(2 * point.slack * inverse);
  return result;
}

// The query plane u -> g[0] + g[1] u_0 + g[2] u_1 + g[3] u_2 in the coordinates of each child's
// dual box.
struct DualPlane {
  Float4 g[4];
  Float4 half;  // largest |g - g[0]| over the box, widened
};
DualPlane dual_plane(const ForestNode& node, const FramePoint& at) {
  DualPlane plane;
  for (int i = 0; i < 4; ++i) {
    const Float4* row = node.rows[i];
    plane.g[i] = row[0] * at.x[0] + row[1] * at.x[1] + row[2] * at.x[2] + row[3];
  }
  plane.half = abs(plane.g[1]) + abs(plane.g[2]) + abs(plane.g[3]) + at.error;
  return plane;
}

// The length of silhouettes that a child is expected to hold, given the query plane. With planes
// spread evenly over the dual box, the values of g - g[0] have nearly the density of the sum of two
// uniform numbers, one of half-width a = max |g[k]| and one of what is left of half: flat, with
// ramps at both ends. A single edge that is met counts in full.
Float4 expected_length(const ForestNode& node, const DualPlane& plane, float error, bool soft) {
  const Float4 size[3] = {abs(plane.g[1]) + error, abs(plane.g[2]), abs(plane.g[3])};
  const Float4 widest = max(size[0], max(size[1], size[2]));
  const Float4 length =
      (size[0] * node.cover[0] + size[1] * node.cover[1] + size[2] * node.cover[2]) / widest;
  if (!soft) return length;
  const Float4 rest = plane.half - widest;
  const Float4 ramp = clamp(0.5f * (plane.half - abs(plane.g[0])) / max(rest, splat(1e-30f)),
                            splat(kShallow), splat(1.0f));
  // Not every box that is met holds a silhouette: the power makes up for part of that.
  return length * select(node.child < 0, splat(1.0f), ramp * sqrt(ramp));
}

// Radiance that may come from behind the boxes, from lights and environment.
Float4 brightness(const ForestQuery& query, const Float4x3& d, const Float4x3& half, Float4 tangent,
                  Int4 alive) {
  Float4 sum = splat(0.0f);
  if (query.lights) sum = query.lights->mean_over_boxes(d, half);
  if (!query.environment) return sum;
  for (int lane = 0; lane < kWidth; ++lane) {
    if (!alive[lane]) continue;
    sum[lane] += query.environment->mean(d.x[lane], d.y[lane], d.z[lane], tangent[lane]);
  }
  // Where the environment is dark, edges still jump against the objects that it lights.
  return sum + kScattered * query.environment->mean();
}

}  // namespace

ForestPoint point_of(const Forest& forest, const Vec3d& p) {
  EdgeMesh farthest;
  farthest.extent = forest.extent;
  return {p, distance_error(farthest, p)};
}

ForestQuery::ForestQuery(const Forest& forest, const LightClusters* clusters,
                         const RadiancePyramid* pyramid, const EdgeQuery& query,
                         const Lanes& lane_scale)
    : point(point_of(forest, query.p)), lobe(query.lobe, query.n, query.wi), environment(pyramid) {
  if (clusters) lights.emplace(*clusters, query.p);
  for (int k = 0; k < 3; ++k) n[k] = static_cast<float>(query.n[k]);
  const Vec3<Lanes>& v = query.velocity;
  double sum = 0;
  for (int i = 0; i < kLanes; ++i)
    sum += lane_scale[i] * std::sqrt(v.x[i] * v.x[i] + v.y[i] * v.y[i] + v.z[i] * v.z[i]);
  speed = static_cast<float>(sum);
}

Int4 may_hold_candidates(const ForestNode& node, const ForestPoint& point) {
  const Int4 present = node.child != kNoChild;
  if (node.group == ForestGroup::kAlways) return present;
  const FramePoint at = to_frame(node, point);
  const DualPlane plane = dual_plane(node, at);
  if (node.group == ForestGroup::kFront) return present & (plane.g[0] + plane.half >= 0);
  return present & (abs(plane.g[0]) <= plane.half);
}

Float4 weigh_children(const ForestNode& node, const ForestQuery& query, bool soft) {
  const FramePoint at = to_frame(node, query.point);
  Int4 alive = node.child != kNoChild;
  const Float4x3 d{node.box_center[0] - at.x[0], node.box_center[1] - at.x[1],
                   node.box_center[2] - at.x[2]};
  const Float4* e = node.box_half;
  const float* n = query.n;
  const Float4 height = d.x * n[0] + d.y * n[1] + d.z * n[2] + e[0] * std::fabs(n[0]) +
                        e[1] * std::fabs(n[1]) + e[2] * std::fabs(n[2]);
  alive &= height >= -16 * 0x1.0p-24f * at.size;
  const Float4 speed = query.speed + node.speed;
  alive &= speed > 0;

  const DualPlane plane = dual_plane(node, at);
  Float4 length = node.cover[0];
  if (node.group == ForestGroup::kSilhouette) {
    alive &= abs(plane.g[0]) <= plane.half;
    length = expected_length(node, plane, at.error, soft);
  } else if (node.group == ForestGroup::kFront) {
    alive &= plane.g[0] + plane.half >= 0;
    if (soft) length *= clamp(0.5f + 0.5f * plane.g[0] / plane.half, splat(kShallow), splat(1.0f));
  }
  const Float4x3 half{e[0], e[1], e[2]};
  const Float4 distance2 = max(dot(d, d), kNear * dot(half, half) + 1e-30f);
  Float4 weight = length * speed / distance2 * query.lobe.mean_over_boxes(d, half);
  if (query.lights || query.environment) {
    weight *= brightness(query, d, half, sqrt(dot(half, half) / distance2), alive);
  }
  return select(alive, max(weight, splat(std::numeric_limits<float>::min())), splat(0.0f));
}

}  // namespace limn
