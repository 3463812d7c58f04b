// Clusters of lights, and the estimated radiance behind a box.
#include "edgetree/light/light_term.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// Albedo of objects, which are assumed to receive the same light as the shading point and to
// scatter it uniformly over the hemisphere. Not tuned.
constexpr double kReflectance = 0.5;
// Lower bound of weights, as a share of the brightest light's luminance: visible objects may
// receive light that does not reach this point. Not tuned.
constexpr double kFloor = 1.0 / 4096;

Vec3d centroid(const LightTriangle& t) {
  return (t.corners[0] + t.corners[1] + t.corners[2]) / 3.0;
}

}  // namespace

LightClusters::LightClusters(std::span<const LightTriangle> lights, double environment_luminance)
    : environment_(environment_luminance) {
  std::vector<uint32_t> shining;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    const Vec3d* c = lights[i].corners;
    if (lights[i].luminance > 0 && length_squared(cross(c[1] - c[0], c[2] - c[0])) > 0)
      shining.push_back(i);
  }
  if (shining.empty()) return;
  clusters_.push_back(make_cluster(lights, shining));
  while (clusters_.size() < kMaxClusters) {
    // The cluster with the largest power times squared extent.
    Cluster* best = nullptr;
    double best_score = 0;
    for (Cluster& c : clusters_) {
      const double score = c.luminance * c.area * c.radius * c.radius;
      if (score > best_score && !is_compact(c)) {
        best = &c;
        best_score = score;
      }
    }
    if (!best) break;
    std::array<Cluster, 2> parts = split(lights, *best);
    *best = std::move(parts[0]);
    clusters_.push_back(std::move(parts[1]));
  }
  for (const Cluster& c : clusters_) floor_ = std::max(floor_, kFloor * c.luminance);
}

LightClusters::Cluster LightClusters::make_cluster(std::span<const LightTriangle> lights,
                                                   std::vector<uint32_t> triangles) {
  Cluster cluster;
  Bounds bounds;
  double power = 0;
  for (uint32_t i : triangles) {
    const LightTriangle& t = lights[i];
    const Vec3d area_vector = cross(t.corners[1] - t.corners[0], t.corners[2] - t.corners[0]) * 0.5;
    for (const Vec3d& corner : t.corners) bounds.extend(corner);
    cluster.area_vector += area_vector;
    cluster.area += length(area_vector);
    power += t.luminance * length(area_vector);
  }
  cluster.luminance = power / cluster.area;
  cluster.center = bounds.center();
  for (uint32_t i : triangles)
    for (const Vec3d& corner : lights[i].corners)
      cluster.radius = std::max(cluster.radius, length(corner - cluster.center));
  cluster.triangles = std::move(triangles);
  return cluster;
}

// A single triangle, or a flat patch that fills half of its bounding disc (a square: 0.64). Neither
// the half nor the flatness is tuned.
bool LightClusters::is_compact(const Cluster& c) {
  const bool flat = length(c.area_vector) >= 0.999 * c.area;
  return c.triangles.size() == 1 || (flat && c.area >= 0.5 * kPi * c.radius * c.radius);
}

// Splits at the median, along the longest axis of the centroids' bounds.
std::array<LightClusters::Cluster, 2> LightClusters::split(std::span<const LightTriangle> lights,
                                                           const Cluster& cluster) {
  Bounds bounds;
  for (uint32_t i : cluster.triangles) bounds.extend(centroid(lights[i]));
  const Vec3d size = bounds.upper - bounds.lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  std::vector<uint32_t> order = cluster.triangles;
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
    return centroid(lights[a])[axis] < centroid(lights[b])[axis];
  });
  const auto middle = order.begin() + static_cast<long>(order.size() / 2);
  return {make_cluster(lights, {order.begin(), middle}),
          make_cluster(lights, {middle, order.end()})};
}

// A cluster's projected area from p: a flat one shows its area vector; the part that cancels in the
// area vector counts as a closed surface, which shows a quarter of its area.
LightCones::LightCones(const LightClusters& lights, const Vec3d& p) {
  double scattered = 0;
  for (const LightClusters::Cluster& c : lights.clusters_) {
    const Vec3d to = c.center - p;
    const double d2 = length_squared(to), r2 = c.radius * c.radius;
    const double distance = std::sqrt(d2);
    const double facing = distance > 0 ? -dot(c.area_vector, to) / distance : 0;
    const double visible =
        std::max(0.0, facing) + 0.25 * std::max(0.0, c.area - length(c.area_vector));
    // Between the values for the distances of center and boundary; at most a hemisphere.
    const double solid_angle = std::min(visible / (d2 + r2 / 8), 2 * kPi);
    // Nearby objects may face the light even if this point does not.
    scattered += c.luminance * std::min(c.area / (d2 + r2 / 8), 2 * kPi);
    if (solid_angle <= 0) continue;
    // sin of the bounding cone is radius / distance: squared chord 2 - 2 cos; 4 from inside.
    const double outer2 = d2 > r2 ? 2 * r2 / d2 / (1 + std::sqrt(1 - r2 / d2)) : 4;
    const double chord = std::sqrt(solid_angle / kPi);
    const Vec3d axis = distance > 0 ? to / distance : Vec3d{0, 0, 1};
    cones_[count_++] = {
        {static_cast<float>(axis.x), static_cast<float>(axis.y), static_cast<float>(axis.z)},
        static_cast<float>(c.luminance),
        static_cast<float>(chord),
        static_cast<float>(std::max(std::sqrt(outer2), chord))};
  }
  base_ = static_cast<float>(lights.environment_ +
                             std::max(kReflectance / kPi * scattered, lights.floor_));
}

// Overlap of two caps, with D the distance of their centers: the smaller is inside of the other if
// D is below the difference of their chords; they are disjoint if D exceeds the sum of the outer
// chords; between, the overlap is quadratic in the remaining distance.
Floats LightCones::mean_over_boxes(Floats3 center, const Floats3& half) const {
  const Floats zero = splat(0.0f), one = splat(1.0f), tiny = splat(0x1p-60f);
  const Floats center2 = max(dot(center, center), splat(0x1p-126f)), half2 = dot(half, half);
  center = center * (1 / sqrt(center2));
  // A box around p (share 1) is the whole sphere, chord 2; a distant cube has chord^2 = 2 |half|^2
  // and extends |half| sideways.
  const Floats share = half2 / (center2 + half2);
  const Floats chord2 =
      share * (static_cast<float>(2 / kPi) + static_cast<float>(4 - 2 / kPi) * share) + tiny;
  const Floats chord = sqrt(chord2), chord_outer = sqrt(share * (1 + 3 * share));
  Floats sum = splat(base_);
  for (int i = 0; i < count_; ++i) {
    const Cone& c = cones_[i];
    const Floats cosine = center.x * c.axis[0] + center.y * c.axis[1] + center.z * c.axis[2];
    const Floats distance = sqrt(max(2 - 2 * cosine, zero));
    const Floats outer = chord_outer + c.chord_outer, inner = abs(chord - c.chord);
    const Floats overlap = clamp((outer - distance) / max(outer - inner, tiny), zero, one);
    sum = sum + c.luminance * overlap * overlap * min(c.chord * c.chord / chord2, one);
  }
  return sum;
}

}  // namespace limn
