// Rejection and weights of a node's children: the inner loop of a draw.
#include "edgetree/forest/forest_query.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "edgetree/light/light_term.h"

namespace limn {
namespace {

// Least expected length at a corner of a dual box, as a share of that in the middle. Tuned together
// with the exponent of the ramp in expected_length.
constexpr float kShallow = 0.1f;
// Lower bound of the squared distance of a box, as a share of its squared radius. Not tuned.
constexpr float kNear = 0.25f;
// Radiance of objects, as a share of the environment's mean that lights them. A quarter left rare
// bright samples (edgetree/FIGURES.md).
constexpr float kScattered = 1.0f;

// Lower bound of the speed across the line of sight, as a share of the total speed. For nodes 0.2
// gives equal second moments, within noise; for edges it is not tuned.
constexpr float kSlowest = 0.1f, kSlowestEdge = 0.01f;
// Mean squared cosine between a motion across the line of sight and a normal with a uniform
// direction across it.
constexpr float kAnyNormal = 0.5f;
// Mean square of a coordinate over a dual box: 1/3 for a uniform distribution, 1 at the sides. With
// 1/3 the second moment of the plant's draws is 1.17 times as high.
constexpr float kSpread = 2 / 3.0f;
// Where a dual box is much wider than the planes in it are long, normals may have any direction;
// this is the squared threshold on that length. Without it such nodes seem static, and the second
// moment of the chandelier's draws is 2.6 times as high; any value from 0.01 to 0.05 works.
constexpr float kVague = 0.02f;
// Bound of the rounding error of speeds in SeenMotion.
constexpr float kMotionRounding = 0x1p-21f;

constexpr float kLeast = std::numeric_limits<float>::min();
// Above every meaningful weight, yet sums of many stay finite.
constexpr float kMost = 0x1p100f;

// p in the frame of a node, and a bound of the rounding error of row . x over all rows together:
// entries of rows and of x have 2^-24 each, products four roundings and sums two; row lengths sum
// to 1.
struct FramePoint {
  float x[3];
  float error;
  float size;  // sum of |x| and 1
};
FramePoint to_frame(const NodeHead& head, const ForestPoint& point) {
  FramePoint result;
  const double inverse = head.inverse_radius;
  result.size = 1;
  for (int k = 0; k < 3; ++k) {
    result.x[k] = static_cast<float>((point.p[k] - head.center[k]) * inverse);
    result.size += std::fabs(result.x[k]);
  }
  result.error = 12 * 0x1.0p-24f * result.size + static_cast<float>(2 * point.slack * inverse);
  return result;
}

Floats row_product(const Floats row[4], const FramePoint& at) {
  return row[0] * at.x[0] + row[1] * at.x[1] + row[2] * at.x[2] + row[3];
}

// The query plane u -> g[0] + g[1] u_0 + g[2] u_1 + g[3] u_2 in each child's dual
// box.
struct DualPlane {
  Floats g[4];
  Floats half;  // largest |g - g[0]| over the box, enlarged
};
DualPlane dual_plane(const InnerNode& node, const FramePoint& at) {
  DualPlane plane;
  for (int i = 0; i < 4; ++i) plane.g[i] = row_product(node.rows[i], at);
  plane.half = abs(plane.g[1]) + abs(plane.g[2]) + abs(plane.g[3]) + at.error;
  return plane;
}

// The query plane in the dual segments of edges.
struct DualSegment {
  Floats middle;
  Floats half;  // enlarged
};
DualSegment dual_segment(const EdgeNode& node, const FramePoint& at) {
  return {row_product(node.rows[0], at), abs(row_product(node.rows[1], at)) + at.error};
}

Ints between_planes(Floats middle, Floats half) { return abs(middle) <= half; }

Ints not_rejected(ForestGroup group, Floats middle, Floats half) {
  if (group == ForestGroup::kSilhouette) return between_planes(middle, half);
  if (group == ForestGroup::kFront) return middle + half >= 0;
  return Ints{} - 1;
}

// Expected length of silhouettes below a child, given the query plane. For planes uniform in
// the dual box, the values of g - g[0] have nearly the density of a sum of two uniform numbers,
// of half-width a = max |g[k]| and of the remainder of `half`: constant, with ramps at both
// ends.
Floats expected_length(const InnerNode& node, const DualPlane& plane, float error, bool soft) {
  const Floats size[3] = {abs(plane.g[1]) + error, abs(plane.g[2]), abs(plane.g[3])};
  const Floats widest = max(size[0], max(size[1], size[2]));
  const Floats length =
      (size[0] * node.cover[0] + size[1] * node.cover[1] + size[2] * node.cover[2]) / widest;
  if (!soft) return length;
  const Floats rest = plane.half - widest;
  const Floats ramp = clamp(0.5f * (plane.half - abs(plane.g[0])) / max(rest, splat(kLeast)),
                            splat(kShallow), splat(1.0f));
  // Partially accounts for boxes that are cut but hold no silhouette.
  return length * (ramp * sqrt(ramp));
}

// Not positive for rejected children.
Floats length_of(const InnerNode& node, const FramePoint& at, const DualPlane& plane, bool soft) {
  const ForestGroup group = node.head.group;
  if (group == ForestGroup::kAlways) return node.cover[0];
  const Floats length = select(between_planes(plane.g[0], plane.half),
                               expected_length(node, plane, at.error, soft), splat(0.0f));
  if (group == ForestGroup::kSilhouette) return length;
  Floats folds = node.folds;
  if (soft && group == ForestGroup::kFront)
    folds *= clamp(0.5f + 0.5f * plane.g[0] / plane.half, splat(kShallow), splat(1.0f));
  return select(not_rejected(group, plane.g[0], plane.half), length + folds, splat(0.0f));
}

// The weight of each edge over that of a silhouette: less for folds, 0 for rejected edges.
Floats share_of(const EdgeNode& node, const FramePoint& at) {
  const ForestGroup group = node.head.group;
  if (group == ForestGroup::kAlways) return splat(1.0f);
  const DualSegment segment = dual_segment(node, at);
  const Ints alive = not_rejected(group, segment.middle, segment.half);
  Floats share = splat(1.0f);
  if (has_folds(group) && node.head.fold < std::numeric_limits<float>::infinity()) {
    // The rows are in proportion to the sum and the difference of the faces' planes.
    const auto square = [&](int i) {
      const Floats* row = node.rows[i];
      return row[0] * row[0] + row[1] * row[1] + row[2] * row[2];
    };
    const Floats tangent2 = square(1) / max(square(0), splat(kLeast));
    const Floats fold = clamp(2 * node.head.fold * sqrt(tangent2), splat(kLeastFold), splat(1.0f));
    share = select(between_planes(segment.middle, segment.half), share, fold);
  }
  return select(alive, share, splat(0.0f));
}

Floats length_of(const EdgeNode& node, const FramePoint& at) {
  return node.length * share_of(node, at);
}

// Radiance that may arrive from behind the boxes: lights and environment.
Floats brightness(const ForestQuery& query, const Floats3& d, const Floats3& half, Floats tangent,
                  Ints alive) {
  Floats sum = splat(0.0f);
  if (query.lights) sum = query.lights->mean_over_boxes(d, half);
  if (!query.environment) return sum;
  sum += select(alive, means(*query.environment, d, tangent), splat(0.0f));
  // In front of a dark environment, radiance still differs from that of lit objects.
  return sum + kScattered * query.environment->mean();
}

// Boxes of a node's children: centers minus p, and half extents.
void boxes_of(const InnerNode& node, const FramePoint& at, Floats3& d, Floats3& half) {
  Floats* centers[3] = {&d.x, &d.y, &d.z};
  Floats* halves[3] = {&half.x, &half.y, &half.z};
  for (int k = 0; k < 3; ++k) {
    const Ints low = node.low >> (k * kBoxBits) & kBoxSteps;
    const Ints high = node.high >> (k * kBoxBits) & kBoxSteps;
    *centers[k] = to_float(low + high) * (1.0f / kBoxSteps) - (1 + at.x[k]);
    *halves[k] = to_float(high - low) * (1.0f / kBoxSteps);
  }
}

// End e of the edges minus p, times the query's unit.
template <class Query>
Floats3 end_of(const EdgeNode& node, const Query& query, int e) {
  const auto coordinate = [&](int k) {
    return (node.ends[e][k] * query.unit - query.p[0][k]) - query.p[1][k];
  };
  return {coordinate(0), coordinate(1), coordinate(2)};
}

Floats dot_n(const ForestQuery& query, const Floats3& d) {
  return d.x * query.n[0] + d.y * query.n[1] + d.z * query.n[2];
}

// Mask of edges with an end exactly at p. Their Jacobian is zero, and rounding makes candidates of
// all of them.
Ints ends_at(const EdgeNode& node, const Vec3d& p) {
  Ints at = Ints{};
  for (const auto& end : node.ends) {
    const auto equal = [&](int k) { return end[k] == static_cast<float>(p[k]); };
    at |= equal(0) & equal(1) & equal(2);
  }
  return at;
}

// Mask of the edges of the query's own face, which lie in its plane: most others need no access to
// the mesh. Arguments: ends minus p in the query's unit.
Ints own_edges(const EdgeNode& node, const ForestQuery& query, const Floats3& w_0,
               const Floats3& w_1, Ints alive) {
  const Vec3d& normal = query.own_plane->n;
  const float m[3] = {static_cast<float>(normal.x), static_cast<float>(normal.y),
                      static_cast<float>(normal.z)};
  const auto height = [&](const Floats3& w) { return abs(w.x * m[0] + w.y * m[1] + w.z * m[2]); };
  constexpr float kNearPlane = 0x1.0p-16f;  // far beyond rounding; not tuned
  Ints own = Ints{};
  const Ints near = alive & (max(height(w_0), height(w_1)) <= kNearPlane);
  for (uint32_t lanes = bits(near); lanes != 0; lanes &= lanes - 1) {
    const int lane = std::countr_zero(lanes);
    if (is_own_edge(query.input, query.source, node.edge_at(lane))) own[lane] = -1;
  }
  return own;
}

// Squared distance of the boxes from p; from inside, a lower bound relative to their size.
Floats nearest2_of(const Floats3& d, const Floats3& half) {
  constexpr float kInside = 0.01f;  // not tuned
  const auto outside = [](Floats x, Floats h) { return max(abs(x) - h, splat(0.0f)); };
  const Floats3 to{outside(d.x, half.x), outside(d.y, half.y), outside(d.z, half.z)};
  return max(dot(to, to), kInside * dot(half, half));
}

// w: (x - p) times the factor that converts it to the query's unit.
Floats3 velocity_at(const SeenMotion::Lane& lane, const Floats3& w, float unit) {
  const auto row = [&](int k) {
    const float* a = lane.linear[k];
    return lane.at_p[k] + (w.x * a[0] + w.y * a[1] + w.z * a[2]) * unit;
  };
  return {row(0), row(1), row(2)};
}

// Normals of the planes through p and the silhouettes below a child, in its dual box: the center of
// the box's intersection with the query plane, and the extent around it.
struct Normals {
  Floats3 middle;
  Floats3 rows[3];
  Floats g[3];
  Floats inverse_g2, inverse_n2;

  Normals(const InnerNode& node, const DualPlane& plane) {
    const auto normal = [&](int i) {
      return Floats3{node.rows[i][0], node.rows[i][1], node.rows[i][2]};
    };
    middle = normal(0);
    for (int k = 0; k < 3; ++k) g[k] = plane.g[k + 1];
    inverse_g2 = 1 / max(g[0] * g[0] + g[1] * g[1] + g[2] * g[2], splat(kLeast));
    for (int k = 0; k < 3; ++k) {
      rows[k] = normal(k + 1);
      const Floats u = clamp(-plane.g[0] * inverse_g2 * g[k], splat(-1.0f), splat(1.0f));
      middle = {middle.x + rows[k].x * u, middle.y + rows[k].y * u, middle.z + rows[k].z * u};
    }
    inverse_n2 = 1 / (dot(middle, middle) + kVague);
  }
  // Mean square of v along the normals; side2: squared component of v across the line of sight.
  Floats along2(const Floats3& v, Floats side2) const {
    const Floats in_middle = dot(v, middle);
    Floats squares{}, across{};
    for (int k = 0; k < 3; ++k) {
      const Floats a = dot(v, rows[k]);
      squares += a * a;
      across += g[k] * a;
    }
    const Floats spread = max(squares - across * across * inverse_g2, splat(0.0f)) * kSpread;
    const Floats sum = in_middle * in_middle + spread + (kVague * kAnyNormal) * side2;
    return min(sum * inverse_n2, side2);
  }
};

// Mean speed of edges below a child along the normals of the planes through p and them. d, half:
// its box, from boxes_of.
Floats speed_below(const InnerNode& node, const ForestQuery& query, const DualPlane& plane,
                   const Floats3& d, const Floats3& half) {
  const SeenMotion& motion = query.seen(node.head.motion);
  const float unit = query.unit / node.head.inverse_radius;
  const bool silhouettes = node.head.group == ForestGroup::kSilhouette;
  std::optional<Normals> normals;
  if (silhouettes) normals.emplace(node, plane);
  const Floats3 half_squares{half.x * half.x, half.y * half.y, half.z * half.z};
  const Floats half2 = half_squares.x + half_squares.y + half_squares.z;
  const Floats inverse_d2 = 1 / max(dot(d, d), half2);
  Floats sum = node.speed;
  for (int i = 0; i < motion.count; ++i) {
    const SeenMotion::Lane& lane = motion.lanes[i];
    const Floats3 v = velocity_at(lane, d, unit);
    const Floats v2 = dot(v, v), towards = dot(v, d);
    const Floats side2 = v2 - towards * towards * inverse_d2;
    // Mean square over the box of the change of velocity from its center.
    const float third = unit * unit / 3;
    const Floats within2 = half_squares.x * (lane.column2[0] * third) +
                           half_squares.y * (lane.column2[1] * third) +
                           half_squares.z * (lane.column2[2] * third);
    const Floats across2 = normals ? normals->along2(v, side2) : side2 * kAnyNormal;
    const Floats speed2 = query.any_direction ? v2 : max(across2, v2 * (kSlowest * kSlowest));
    sum += (sqrt(speed2 + within2) + kMotionRounding) * lane.size;
  }
  return sum;
}

// The speed of edges with the ends w_0 and w_1 minus p, in the query's unit. normal: of the planes
// through p and them, of any length.
Floats speed_of(const EdgeNode& node, const ForestQuery& query, const Floats3& w_0,
                const Floats3& w_1, const Floats3& normal) {
  const SeenMotion& motion = query.seen(node.head.motion);
  const Floats quarter_inverse = 0.25f / max(dot(normal, normal), splat(kLeast));
  Floats sum = node.speed;
  for (int i = 0; i < motion.count; ++i) {
    const SeenMotion::Lane& lane = motion.lanes[i];
    const Floats3 v_0 = velocity_at(lane, w_0, 1), v_1 = velocity_at(lane, w_1, 1);
    const Floats v2 = max(dot(v_0, v_0), dot(v_1, v_1));
    const Floats twice = abs(dot(v_0, normal)) + abs(dot(v_1, normal));
    const Floats across2 = twice * twice * quarter_inverse;
    const Floats speed2 =
        query.any_direction ? v2 : max(across2, v2 * (kSlowestEdge * kSlowestEdge));
    sum += (sqrt(speed2) + kMotionRounding) * lane.size;
  }
  return sum;
}

// Mean of f_s times luminance over boxes, given the mean of f_s.
Floats light_through(const ForestQuery& query, Floats lobe, const Floats3& d, const Floats3& half,
                     Floats distance2, Ints alive) {
  if (!query.lights && !query.environment) return lobe;
  return lobe * brightness(query, d, half, sqrt(dot(half, half) / distance2), alive);
}

}  // namespace

// Rounds to the nearest float. Not inlined, because GCC 12 drops a cast to float and back when it
// vectorises.
__attribute__((noinline)) static double nearest_float(double x) { return static_cast<float>(x); }

ForestPoint point_of(const Forest& forest, const Vec3d& p) {
  EdgeMesh farthest;
  farthest.extent = forest.extent;
  bool is_float = true;
  for (int k = 0; k < 3; ++k) is_float = is_float && nearest_float(p[k]) == p[k];
  return {p, distance_error(farthest, p), is_float};
}

static float unit_of(const Forest& forest, const Vec3d& p) {
  const double size = forest.extent + std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z);
  int exponent = 0;
  std::frexp(size, &exponent);
  return std::ldexp(1.0f, std::clamp(-exponent, -126, 126));
}

// unit * p as the sum of two floats per coordinate.
static void split(const Vec3d& p, float unit, float (&parts)[2][3]) {
  for (int k = 0; k < 3; ++k) {
    const double x = p[k] * unit;
    const double high = nearest_float(x);
    parts[0][k] = static_cast<float>(high);
    parts[1][k] = static_cast<float>(x - high);
  }
}

bool is_at_rest(const EdgeQuery& query, const Lanes& lane_scale) {
  return sum_of_speeds(scaled_velocity(query.velocity, lane_scale)) == 0 &&
         sum_of_speeds(scaled_velocity(query.turn.rate, lane_scale)) == 0;
}

ForestQuery::ForestQuery(const Forest& tree, const LightClusters* clusters,
                         const RadiancePyramid* pyramid, const EdgeQuery& query,
                         const EdgeSamplerInput& scene)
    : forest(tree),
      point(point_of(forest, query.p)),
      lobe(query.lobe, query.n, query.wi),
      environment(pyramid),
      input(scene),
      source(query),
      at_rest(is_at_rest(query, scene.lane_scale)) {
  if (clusters) lights.emplace(*clusters, query.p);
  for (int k = 0; k < 3; ++k) n[k] = static_cast<float>(query.n[k]);
  unit = unit_of(forest, query.p);
  split(query.p, unit, p);
  viewer_.emplace(query, scene.lane_scale, unit);
  if (query.face.shape.valid()) own_plane = scene.object(query.face.shape).plane(query.face.face);
}

const SeenMotion& ForestQuery::seen(uint32_t motion) const {
  if (motion != motion_) {
    seen_ = SeenMotion(forest.motions[motion], *viewer_);
    motion_ = motion;
  }
  return seen_;
}

Ints may_hold_candidates(const InnerNode& node, const ForestPoint& point) {
  const FramePoint at = to_frame(node.head, point);
  const DualPlane plane = dual_plane(node, at);
  Ints alive = not_rejected(node.head.group, plane.g[0], plane.half);
  return (node.child != kNoChild) & alive;
}

Ints may_hold_candidates(const EdgeNode& node, const ForestPoint& point) {
  const DualSegment segment = dual_segment(node, to_frame(node.head, point));
  return (node.edge != kNoChild) & not_rejected(node.head.group, segment.middle, segment.half);
}

bool surely_candidate(const EdgeNode& node, int lane, const ForestPoint& point) {
  if (rejects_none(node.head.group)) return true;
  const FramePoint at = to_frame(node.head, point);
  const DualSegment segment = dual_segment(node, at);
  // Removes twice the error from `half`, which was enlarged by it once.
  return not_rejected(node.head.group, segment.middle, segment.half - 2 * at.error)[lane] != 0;
}

ForestCone::ForestCone(const Forest& forest, const EdgeQuery& query, const DirectionCone& cone,
                       const Lanes& lane_scale)
    : point(point_of(forest, query.p)),
      at_rest(is_at_rest(query, lane_scale)),
      slack(static_cast<float>(cone.slack)),
      unit(unit_of(forest, query.p)) {
  const auto add = [&](const Vec3d& plane) {
    for (int k = 0; k < 3; ++k) planes[count][k] = static_cast<float>(plane[k]);
    ++count;
  };
  add(query.n);
  for (int i = 0; i < cone.count; ++i) add(cone.planes[i]);
  split(query.p, unit, p);
}

// Boxes are enlarged by more than the rounding here, except that of the product.
Ints may_hold_outlines(const InnerNode& node, const ForestCone& cone) {
  const FramePoint at = to_frame(node.head, cone.point);
  Ints alive = node.child != kNoChild;
  if (node.head.group != ForestGroup::kAlways) {
    const DualPlane plane = dual_plane(node, at);
    alive &= abs(plane.g[0]) <= plane.half;
  }
  if (cone.at_rest) alive &= node.speed > 0;
  if (bits(alive) == 0) return alive;
  Floats3 d, half;
  boxes_of(node, at, d, half);
  const Floats far = abs(d.x) + abs(d.y) + abs(d.z) + half.x + half.y + half.z;
  const Floats slack = far * cone.slack + 16 * 0x1.0p-24f * at.size;
  for (int i = 0; i < cone.count; ++i) {
    const float* m = cone.planes[i];
    const Floats height = (d.x * m[0] + d.y * m[1] + d.z * m[2]) + half.x * std::fabs(m[0]) +
                          half.y * std::fabs(m[1]) + half.z * std::fabs(m[2]);
    alive &= height >= -slack;
  }
  return alive;
}

Ints may_hold_outlines(const EdgeNode& node, const ForestCone& cone) {
  Ints alive = node.edge != kNoChild;
  if (node.head.group != ForestGroup::kAlways) {
    const DualSegment segment = dual_segment(node, to_frame(node.head, cone.point));
    alive &= abs(segment.middle) <= segment.half;
  }
  if (cone.at_rest) alive &= node.speed > 0;
  if (cone.point.may_be_vertex) alive &= ~ends_at(node, cone.point.p);
  if (bits(alive) == 0) return alive;
  const Floats3 w_0 = end_of(node, cone, 0), w_1 = end_of(node, cone, 1);
  const Floats far =
      (abs(w_0.x) + abs(w_0.y) + abs(w_0.z)) + (abs(w_1.x) + abs(w_1.y) + abs(w_1.z));
  const Floats slack = far * (cone.slack + 8 * 0x1.0p-24f);
  for (int i = 0; i < cone.count; ++i) {
    const float* m = cone.planes[i];
    const Floats a = w_0.x * m[0] + w_0.y * m[1] + w_0.z * m[2];
    const Floats b = w_1.x * m[0] + w_1.y * m[1] + w_1.z * m[2];
    alive &= max(a, b) >= -slack;
  }
  return alive;
}

// Nonzero motion, light or length must not underflow.
Floats ChildWeights::product() const {
  return select((length > 0) & (rest > 0), max(length * rest, splat(kLeast)), splat(0.0f));
}

ChildWeights weigh_children(const InnerNode& node, const ForestQuery& query, bool soft,
                            Floats* uncertainty) {
  const FramePoint at = to_frame(node.head, query.point);
  const DualPlane plane = dual_plane(node, at);
  const Floats length = length_of(node, at, plane, soft);
  Ints alive = length > 0;
  Floats3 d, half;
  boxes_of(node, at, d, half);
  const float* n = query.n;
  const Floats height = dot_n(query, d) + half.x * std::fabs(n[0]) + half.y * std::fabs(n[1]) +
                        half.z * std::fabs(n[2]);
  alive &= height >= -16 * 0x1.0p-24f * at.size;
  // Positive: a child's box is at least a step wide in every direction.
  const Floats distance2 = max(dot(d, d), kNear * dot(half, half));
  const Floats speed = speed_below(node, query, plane, d, half);
  alive &= speed > 0;
  // Prefetches children for two-level importance while light is evaluated.
  for (uint32_t lanes = bits(alive) & node.ahead; lanes != 0; lanes &= lanes - 1)
    query.forest.fetch(node.child[std::countr_zero(lanes)]);
  const Floats lobe = query.lobe.mean_over_boxes(d, half);
  const Floats rest = speed / distance2 * light_through(query, lobe, d, half, distance2, alive);
  if (uncertainty) {
    const Floats most = query.lobe.most_in_boxes(d, half) / max(lobe, splat(kLeast));
    *uncertainty = most * max(distance2 / nearest2_of(d, half), splat(1.0f));
  }
  return {length, select(alive, max(rest, splat(kLeast)), splat(0.0f))};
}

// The integral over the edge of |w x w'| / |w|^3, w = (1 - t) w_0 + t w_1, is tan(gamma / 2) (1 /
// l_0 + 1 / l_1), with the ends' distances l and the angle gamma between them. It is unbounded as p
// approaches an end, and zero at the end. Where rounding of squares decides this wrongly, the
// weight is at most kMost.
Floats weigh_edges(const EdgeNode& node, const ForestQuery& query) {
  const FramePoint at = to_frame(node.head, query.point);
  const Floats3 w_0 = end_of(node, query, 0), w_1 = end_of(node, query, 1);
  const Floats3 along{w_1.x - w_0.x, w_1.y - w_0.y, w_1.z - w_0.z};
  const Floats l_0 = sqrt(dot(w_0, w_0)), l_1 = sqrt(dot(w_1, w_1));
  const Floats3 normal{w_0.y * along.z - w_0.z * along.y, w_0.z * along.x - w_0.x * along.z,
                       w_0.x * along.y - w_0.y * along.x};
  const Floats product = max(l_0 * l_1, splat(kLeast));
  const Floats sine = sqrt(dot(normal, normal)) / product, cosine = dot(w_0, w_1) / product;
  const Floats tangent =
      select(cosine > 0, sine / (1 + cosine), (1 - cosine) / max(sine, splat(1e-6f)));

  const Floats share = share_of(node, at);
  Ints alive = (node.length > 0) & (share > 0);
  if (query.point.may_be_vertex) alive &= ~ends_at(node, query.point.p);
  // Rounding of w and of the product with n.
  const Floats slack = 8 * 0x1.0p-24f * (l_0 + l_1);
  alive &= max(dot_n(query, w_0), dot_n(query, w_1)) >= -slack;
  const Floats3 d{w_0.x + along.x * 0.5f, w_0.y + along.y * 0.5f, w_0.z + along.z * 0.5f};
  const Floats3 half{abs(along.x) * 0.5f, abs(along.y) * 0.5f, abs(along.z) * 0.5f};
  const Floats distance2 = max(max(dot(d, d), kNear * dot(half, half)), splat(kLeast));
  const Floats speed = speed_of(node, query, w_0, w_1, normal);
  alive &= speed > 0;
  const Floats lobe = query.lobe.mean_over_segments(d, along * splat(0.5f));
  if (query.own_plane) alive &= ~own_edges(node, query, w_0, w_1, alive);
  const Floats weight = share * speed * query.unit * tangent * (l_0 + l_1) / product *
                        light_through(query, lobe, d, half, distance2, alive);
  return select(alive, clamp(weight, splat(kLeast), splat(kMost)), splat(0.0f));
}

float length_below(const InnerNode& node, const ForestPoint& point, bool soft,
                   float inverse_radius) {
  const float ratio = inverse_radius / node.head.inverse_radius;
  const FramePoint at = to_frame(node.head, point);
  return sum(length_of(node, at, dual_plane(node, at), soft)) * ratio * ratio;
}
float length_below(const EdgeNode& node, const ForestPoint& point, float inverse_radius) {
  const float ratio = inverse_radius / node.head.inverse_radius;
  Floats length = length_of(node, to_frame(node.head, point));
  if (point.may_be_vertex) length = select(ends_at(node, point.p), splat(0.0f), length);
  return sum(length) * ratio * ratio;
}

}  // namespace limn
