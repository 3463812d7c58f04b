// How fast the scene moves as seen from a point.
#include "integrators/paths/direction_field.h"

#include <algorithm>
#include <cmath>

#include "limn/core/bounds.h"

namespace limn {
namespace {

Vec3d lane_of(const Vec3<Lanes>& v, int lane) { return {v.x[lane], v.y[lane], v.z[lane]}; }
Vec3d derivative(const Vec3<Dual>& v, int lane) { return {v.x.d[lane], v.y.d[lane], v.z.d[lane]}; }

bool is_zero(const Vec3<Lanes>& v) {
  return limn::is_zero(v.x) && limn::is_zero(v.y) && limn::is_zero(v.z);
}

}  // namespace

MotionRates::MotionRates(const Scene& scene, int lanes, const Lanes& steps) {
  for (int lane = 0; lane < lanes; ++lane) {
    const double share = steps[lane] / steps[0];
    add_object(scene, lane, share);
    add_camera(scene, lane, share);
    shares_[lane] = share;
  }
  for (const Source& source : sources_) speed_ += source.speed;
}

// All vertices that move, as one object.
void MotionRates::add_object(const Scene& scene, int lane, double share) {
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
  sources_.push_back({bounds.center(), radius, share * std::sqrt(squares / count), 0, false});
}

void MotionRates::add_camera(const Scene& scene, int lane, double share) {
  const Camera& camera = scene.camera;
  // Of a lens, how fast its rim moves, and turns the rays through it.
  const Dual slope = camera.aperture_radius / camera.focus_distance;
  const double speed =
      length(derivative(camera.origin, lane)) + std::fabs(camera.aperture_radius.d[lane]);
  const double rotation = length(derivative(camera.left, lane)) +
                          length(derivative(camera.up, lane)) +
                          std::fabs(camera.fov.d[lane]) * (kPi / 180) + std::fabs(slope.d[lane]);
  if (!(speed > 0) && !(rotation > 0)) return;
  sources_.push_back(
      {value(camera.origin), camera.near_clip, share * speed, share * rotation, true});
}

double MotionRates::Source::rate_from(double distance) const {
  return speed / std::max(distance, radius) + rotation;
}

double MotionRates::at(const Vec3d& p) const {
  double rate = 0;
  for (const Source& source : sources_) rate += source.rate_from(length(source.center - p));
  return rate;
}

double MotionRates::in_view(const Vec3d& p, double distance) const {
  double rate = 0;
  for (const Source& source : sources_) {
    rate += source.rate_from(source.is_camera ? distance : length(source.center - p));
  }
  return rate;
}

DirectionMotion MotionRates::motion_at(const Vec3d& p, const DirectionField& field) const {
  const double unit = at(p);
  const Vec3d axis = axis_at(p);
  return {{field.turn * unit, axis}, {field.score * unit, axis}, !is_zero(field.score), unit};
}

Vec3d MotionRates::per_turn(const Vec3d& p, const Vec3d& to, const Vec3d& g) const {
  const Vec3d axis = axis_at(p);
  return (axis == Vec3d{} ? cross(to, g) : g * dot(axis, to)) * at(p);
}

double MotionRates::sliding(const Vec3<Lanes>& velocity) const {
  double speed = 0;
  for (int lane = 0; lane < kLanes; ++lane) {
    if (shares_[lane] > 0) speed += shares_[lane] * length(lane_of(velocity, lane));
  }
  return speed_ > 0 ? speed / speed_ : 0;
}

double MotionRates::splitting(const Vec3d& p, const Vec3<Lanes>& velocity, const Vec3d& p0) const {
  const double typical = at(p0);
  if (!(typical > 0)) return 1;
  return at(p) / typical + std::max(0.0, sliding(velocity) - 1);
}

Vec3d MotionRates::axis_at(const Vec3d& p) const {
  if (sources_.empty()) return {};
  for (const Source& source : sources_) {
    if (source.is_camera || !(source.center == sources_[0].center)) return {};
  }
  const Vec3d to = sources_[0].center - p;
  const double distance = length(to);
  return distance > sources_[0].radius ? to / distance : Vec3d{};
}

}  // namespace limn
