// Fields of warped directions, by auxiliary rays.
#include "integrators/paths/warp_field.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "limn/core/error.h"

namespace limn {
namespace {

constexpr double kExponent = 3;  // of K; from 3/2 on K diverges fast enough where B is linear

// Beyond so many widths of the kernel, kappa^(-1/2), no ray comes but one in 10^8.
constexpr double kReach = 6;

// A ray this close to w and to an edge has weights that no double can add up.
constexpr double kLeastDistance = 1e-12;

// The chance of going from one level to the next: work grows by 2 and variance falls by 4, away
// from edges, so that the mean of either is finite. With 2^-5/4 variance times rays was 0.99 to
// 1.23 of what it is, in four closed forms.
const double kLevelShare = std::exp2(-1.5);

Lanes along(const Vec3<Lanes>& v, const Vec3d& w) { return v.x * w.x + v.y * w.y + v.z * w.z; }
Vec3<Lanes> across(const Vec3<Lanes>& v, const Vec3d& w) {
  const Lanes part = along(v, w);
  return v - Vec3<Lanes>{part * w.x, part * w.y, part * w.z};
}
Vec3<Lanes> velocity_of(const Vec3<Dual>& p) { return {p.x.d, p.y.d, p.z.d}; }

void check(const WarpOptions& options) {
  if (options.rays < 2 || options.rays % 2 != 0) {
    throw FieldError(
        "auxiliary rays",
        fmt::format("{}: an even number is needed, since they come in pairs", options.rays));
  }
  if (!(options.kappa >= 1) || !(options.kappa <= 1e12)) {
    throw FieldError(
        "kappa",
        fmt::format("{:.6g} is outside of 1 to 1e12 (the kernel is kappa^(-1/2) radians wide)",
                    options.kappa));
  }
}

}  // namespace

bool WarpSums::add(const Vec3d& w, double kappa, const AuxiliaryRay& ray) {
  const double distance = ray.weight - 1 + ray.boundary;
  if (!(distance >= kLeastDistance)) return false;
  const double kernel = 1 / (distance * distance * distance);
  const double weight = kernel * ray.weight;
  const double slope = kExponent * kappa * kernel / distance * ray.weight * ray.weight;
  const Vec3d gradient = (ray.direction - w * dot(w, ray.direction)) * slope;
  weight_ += weight;
  largest_ = std::max(largest_, weight);
  gradient_ += gradient;
  velocity_ += ray.velocity * weight;
  along_ += along(ray.velocity, gradient);
  return true;
}

void WarpSums::merge(const WarpSums& other) {
  weight_ += other.weight_;
  largest_ = std::max(largest_, other.largest_);
  gradient_ += other.gradient_;
  velocity_ += other.velocity_;
  along_ += other.along_;
}

DirectionWarp WarpSums::warp(const Vec3d& w) const {
  if (!(weight_ > 0)) return {};
  const Vec3<Lanes> x = velocity_ * (1 / weight_);
  return {across(x, w), (along_ - along(x, gradient_)) * (1 / weight_) - along(x, w) * 2};
}

WarpField::WarpField(const Scene& scene, const RayTracer& tracer, const EdgeSamplerInput& edges,
                     const WarpOptions& options, bool unbiased)
    : scene_(scene),
      tracer_(tracer),
      boundary_(scene, edges),
      options_(options),
      unbiased_(unbiased) {
  check(options);
  for (const Shape& shape : scene.shapes) {
    if (shape.mesh.position_tangents.empty()) continue;
    const Bounds bounds = bounds_of(shape.mesh);
    moving_.push_back({bounds.center(), 0.5 * length(bounds.upper - bounds.lower)});
  }
}

bool WarpField::may_move(const SurfacePoint<Dual>& surface, const Vec3d& w) const {
  if (!is_constant(surface.p)) return true;
  const double reach = kReach / std::sqrt(options_.kappa);
  const Vec3d p = value(surface.p);
  for (const Sphere& sphere : moving_) {
    const Vec3d to = sphere.center - p;
    const double distance = length(to);
    if (distance <= sphere.radius) return true;
    const double angle = std::atan2(length(cross(w, to)), dot(w, to));
    if (angle <= std::asin(sphere.radius / distance) + reach) return true;
  }
  return false;
}

AuxiliaryRay WarpField::look(const SurfacePoint<Dual>& surface, const Vec3d& w) const {
  AuxiliaryRay result;
  result.direction = w;
  Ray ray{value(surface.p), w};
  ray.start = surface.start();
  Hit hit;
  if (!tracer_.closest(ray, hit)) return result;
  const Mesh& mesh = scene_.shape(hit.face.shape).mesh;
  const auto corners = face_corners<double>(mesh, hit.face.face);
  const Vec3d e1 = corners[1] - corners[0], e2 = corners[2] - corners[0], n = cross(e1, e2);
  const double t = dot(corners[0] - ray.origin, n) / dot(n, w);
  if (!(t > 0 && t <= 0x1p60)) return result;  // along a needle: by rounding, anything
  const Vec3d q = ray.origin + w * t - corners[0];
  const double inverse = 1 / dot(n, n);
  const double b1 = dot(cross(q, e2), n) * inverse, b2 = dot(cross(e1, q), n) * inverse;
  // A face that is narrower than the rounding of its points has no coordinates across: its middle
  // stands for all.
  const bool wide = std::fabs(b1) <= 2 && std::fabs(b2) <= 2;
  const std::array<double, 3> place =
      wide ? std::array{1 - b1 - b2, b1, b2} : std::array{1.0 / 3, 1.0 / 3, 1.0 / 3};
  Vec3<Lanes> v = -velocity_of(surface.p);
  if (!mesh.position_tangents.empty()) {
    const FaceIndices& vertices = mesh.face(hit.face.face);
    for (int k = 0; k < 3; ++k) v += mesh.position_tangents[vertices[k]] * place[k];
  }
  result.velocity = across(v * (1 / t), w);
  result.boundary = boundary_.at(ray.origin, hit.face, place);
  return result;
}

void WarpField::trace(const SurfacePoint<Dual>& surface, const Vec3d& w, uint64_t count, Rng& rng,
                      WarpSums& sums, RayCount& rays, WarpCount& dropped) const {
  const Frame frame(w);
  for (uint64_t i = 0; i < count; i += 2) {
    // The density exp(kappa (1 - s)) of s = 1 - cosine in [0, 2], inverted.
    const double u = 1 - rng.uniform(), turn = 2 * kPi * rng.uniform();
    const double density = u + (1 - u) * std::exp(-2 * options_.kappa);
    const double s = std::min(2.0, -std::log(density) / options_.kappa);
    const double sine = std::sqrt(s * (2 - s));
    const Vec3d side = frame.to_world({sine * std::cos(turn), sine * std::sin(turn), 0});
    for (const double sign : {1.0, -1.0}) {
      ++rays.closest;
      AuxiliaryRay ray = look(surface, normalize(w * (1 - s) + side * sign));
      ray.weight = 1 / density;
      if (!sums.add(w, options_.kappa, ray)) ++dropped.dropped;
    }
  }
}

bool WarpField::at(const SurfacePoint<Dual>& surface, const Vec3d& w, Rng rng, RayCount& rays,
                   WarpCount& count, DirectionWarp& warp) const {
  if (!may_move(surface, w)) return false;
  const auto fewest = static_cast<uint64_t>(options_.rays);
  ++count.fields;
  WarpSums first;
  if (!unbiased_) {
    trace(surface, w, fewest, rng, first, rays, count);
    count.dominated += first.dominated();
    warp = first.warp(w);
    return true;
  }
  int level = 1;
  double probability = 1 - kLevelShare;
  for (; rng.uniform() < kLevelShare; ++level) probability *= kLevelShare;
  const uint64_t half = fewest << (level - 1);
  trace(surface, w, fewest, rng, first, rays, count);
  WarpSums a = first, b;
  trace(surface, w, half - fewest, rng, a, rays, count);
  trace(surface, w, half, rng, b, rays, count);
  const DirectionWarp halves[2] = {a.warp(w), b.warp(w)}, least = first.warp(w);
  a.merge(b);
  count.dominated += a.dominated();
  const DirectionWarp whole = a.warp(w);
  const double share = 1 / probability;
  warp.velocity =
      least.velocity + (whole.velocity - (halves[0].velocity + halves[1].velocity) * 0.5) * share;
  warp.divergence =
      least.divergence +
      (whole.divergence - (halves[0].divergence + halves[1].divergence) * 0.5) * share;
  return true;
}

}  // namespace limn
