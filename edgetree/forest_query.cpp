#include "forest_query.h"

#include <cmath>
#include <limits>

namespace limn {
namespace {

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

struct Range {
  Float4 low, high;
};
void include(Range& range, Float4 value) {
  range.low = min(value, range.low);
  range.high = max(value, range.high);
}

// Of c + b u + a u^2 over [-1, 1]; inverse: 1 / (4 a).
Range parabola_range(Float4 c, Float4 b, Float4 a, Float4 inverse) {
  const Float4 ends = c + a, size = abs(b);
  Range range{ends - size, ends + size};
  const Float4 vertex = select(size < 2 * abs(a), c - b * b * inverse, ends);
  include(range, vertex);
  return range;
}

// Of c[0] + c[1] u + c[2] v + c[3] u^2 + c[4] u v + c[5] v^2 over [-1, 1]^2: at a corner, at the
// vertex of a side's parabola, or at the one critical point.
Range quadratic_range(const Float4 (&c)[6]) {
  const Float4 inverse_u = 0.25f / c[3], inverse_v = 0.25f / c[5];
  Range range = parabola_range(c[0] + c[2] + c[5], c[1] + c[4], c[3], inverse_u);
  const auto join = [&](const Range& side) {
    range.low = min(range.low, side.low);
    range.high = max(range.high, side.high);
  };
  join(parabola_range(c[0] - c[2] + c[5], c[1] - c[4], c[3], inverse_u));
  join(parabola_range(c[0] + c[1] + c[3], c[2] + c[4], c[5], inverse_v));
  join(parabola_range(c[0] - c[1] + c[3], c[2] - c[4], c[5], inverse_v));
  const Float4 determinant = 4 * c[3] * c[5] - c[4] * c[4];
  const Float4 inverse = 1 / determinant;
  const Float4 u = (c[4] * c[2] - 2 * c[5] * c[1]) * inverse;
  const Float4 v = (c[4] * c[1] - 2 * c[3] * c[2]) * inverse;
  const Int4 inside = (determinant > 0) & (abs(u) < 1) & (abs(v) < 1);
  const Float4 value = c[0] + u * (c[1] + c[3] * u + c[4] * v) + v * (c[2] + c[5] * v);
  include(range, select(inside, value, range.low));
  return range;
}

// With u_2 = f(u_0, u_1) + width t, |t| <= 1, the query plane is a quadratic in (u_0, u_1) plus
// g[3] width t: does its range meet [-g[3] width, g[3] width]?
struct SlabCut {
  Range range;
  Float4 half;
};
SlabCut slab_cut(const ForestNode& node, const DualPlane& plane, float error) {
  const Float4 slope = plane.g[3];
  const Float4 c[6] = {plane.g[0] + slope * node.slab[0],
                       plane.g[1] + slope * node.slab[1],
                       plane.g[2] + slope * node.slab[2],
                       slope * node.slab[3],
                       slope * node.slab[4],
                       slope * node.slab[5]};
  // Errors of g enter with at most 1 + |f|; as much again for what is computed from them.
  constexpr auto kGrowth = static_cast<float>(2 * (1 + kMaxSlab));
  return {quadratic_range(c), abs(slope) * node.slab[6] + kGrowth * error};
}

Int4 meets(const SlabCut& cut) {
  return (cut.range.low <= cut.half) & (cut.range.high >= -cut.half);
}

// Share of the possible positions of the query plane, across box and slab, at which it would meet
// as much as it does: 1 where it cuts the middle.
Float4 box_depth(const DualPlane& plane) { return 1 - abs(plane.g[0]) / plane.half; }
Float4 slab_depth(const SlabCut& cut) {
  const Float4 overlap = min(cut.range.high, cut.half) - max(cut.range.low, -cut.half);
  return overlap / min(cut.range.high - cut.range.low, 2 * cut.half);
}

}  // namespace

ForestPoint point_of(const Forest& forest, const Vec3d& p) {
  EdgeMesh farthest;
  farthest.extent = forest.extent;
  return {p, distance_error(farthest, p)};
}

ForestQuery::ForestQuery(const Forest& forest, const EdgeQuery& query, const Lanes& lane_scale)
    : point(point_of(forest, query.p)), lobe(query.n, query.wi, query.lobe) {
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
  return present & (abs(plane.g[0]) <= plane.half) & meets(slab_cut(node, plane, at.error));
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
  constexpr float kShallow = 0.03f;  // a share that rounding or a bad guess may have missed
  Float4 depth = splat(1.0f);
  if (node.group == ForestGroup::kSilhouette) {
    const SlabCut cut = slab_cut(node, plane, at.error);
    alive &= (abs(plane.g[0]) <= plane.half) & meets(cut);
    // Edges are met or not.
    if (soft) {
      depth = max(box_depth(plane), splat(kShallow)) * max(slab_depth(cut), splat(kShallow));
      depth = select(node.child < 0, splat(1.0f), depth);
    }
  } else if (node.group == ForestGroup::kFront) {
    alive &= plane.g[0] + plane.half >= 0;
    if (soft) depth = clamp(0.5f + 0.5f * plane.g[0] / plane.half, splat(kShallow), splat(1.0f));
  }
  const Float4 cover = (abs(plane.g[1]) + at.error) * node.cover[0] +
                       abs(plane.g[2]) * node.cover[1] + abs(plane.g[3]) * node.cover[2];
  const Float4 radius2 = e[0] * e[0] + e[1] * e[1] + e[2] * e[2];
  const Float4 distance2 = max(dot(d, d), 0.25f * radius2 + 1e-30f);
  const Float4 mean = query.lobe.mean(d, sqrt(distance2), sqrt(radius2));
  const Float4 weight = cover / plane.half * depth * mean * speed / distance2;
  return select(alive, max(weight, splat(std::numeric_limits<float>::min())), splat(0.0f));
}

}  // namespace limn
