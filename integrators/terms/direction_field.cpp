// How fast the scene moves as seen from a point.
#include "integrators/terms/direction_field.h"

#include <algorithm>
#include <cmath>

#include "limn/core/bounds.h"

namespace limn {
namespace {

Vec3d lane_of(const Vec3<Lanes>& v, int lane) { return {v.x[lane], v.y[lane], v.z[lane]}; }
Vec3d derivative(const Vec3<Dual>& v, int lane) { return {v.x.d[lane], v.y.d[lane], v.z.d[lane]}; }

Vec3<Lanes> scaled(const Vec3<Lanes>& v, const Lanes& rates) {
  Vec3<Lanes> result;
  for (int k = 0; k < kLanes; ++k) {
    result.x[k] = v.x[k] * rates[k];
    result.y[k] = v.y[k] * rates[k];
    result.z[k] = v.z[k] * rates[k];
  }
  return result;
}

bool is_zero(const Vec3<Lanes>& v) {
  return limn::is_zero(v.x) && limn::is_zero(v.y) && limn::is_zero(v.z);
}

}  // namespace

MotionRates::MotionRates(const Scene& scene, int lanes) : repeat_(lanes == 1) {
  for (int lane = 0; lane < lanes; ++lane) {
    add_object(scene, lane);
    add_camera(scene, lane);
  }
}

// All vertices that move, as one object.
void MotionRates::add_object(const Scene& scene, int lane) {
  Bounds bounds;
  double squares = 0, count = 0;
  for (const Shape& shape : scene.shapes) {
    for (size_t v = 0; v < shape.mesh.position_tangents.size(); ++v) {
      const double square = length_squared(lane_of(shape.mesh.position_tangents[v], lane));
      if (!(square > 0)) continue;
      bounds.extend(cast<double>(shape.mesh.positions[v]));
      squares += square;
      ++count;
    }
  }
  if (count == 0) return;
  const double radius = 0.5 * length(bounds.upper - bounds.lower);
  if (!(radius > 0)) return;
  sources_.push_back({lane, bounds.center(), radius, std::sqrt(squares / count), 0});
}

void MotionRates::add_camera(const Scene& scene, int lane) {
  const Camera& camera = scene.camera;
  const double speed = length(derivative(camera.origin, lane));
  const double rotation = length(derivative(camera.left, lane)) +
                          length(derivative(camera.up, lane)) +
                          std::fabs(camera.fov.d[lane]) * (kPi / 180);
  if (!(speed > 0) && !(rotation > 0)) return;
  sources_.push_back({lane, value(camera.origin), camera.near_clip, speed, rotation});
}

Lanes MotionRates::at(const Vec3d& p) const {
  Lanes rates;
  for (const Source& source : sources_) {
    const double distance = std::max(length(source.center - p), source.radius);
    rates[source.lane] += source.speed / distance + source.rotation;
  }
  if (repeat_) {
    for (int k = 1; k < kLanes; ++k) rates[k] = rates[0];
  }
  return rates;
}

DirectionMotion MotionRates::motion_at(const Vec3d& p, const DirectionField& field) const {
  const Lanes rates = at(p);
  return {scaled(field.turn, rates), scaled(field.score, rates), !is_zero(field.score)};
}

}  // namespace limn
