#pragma once
// Rays against the triangles of a scene.
#include <array>
#include <cmath>
#include <cstdint>
#include <exception>
#include <limits>
#include <memory>
#include <span>

#include "limn/core/scene.h"

namespace limn {

struct Ray {
  Vec3d origin;
  Vec3d direction;  // unit
  double t_min = 0;
  double t_max = std::numeric_limits<double>::infinity();
  // Faces that the ray never meets: the one it starts on, the one it ends on, and those around an
  // edge that it grazes. By id, never by distance.
  FaceRef start = {};
  FaceRef end = {};
  std::span<const FaceRef> skip_faces = {};
  bool skip_emitters = false;  // hide_emitters, for camera rays
};

struct Hit {
  FaceRef face;
  double t = 0;
};

// What a tracer throws at a ray that it cannot trace. The sample that asked for it is not finite,
// and is reported as such: a miss in its stead would be wrong without a word.
class UntraceableRay final : public std::exception {
 public:
  const char* what() const noexcept override {
    return "a ray is not finite or starts too far away";
  }
};

// Whether Embree can trace it: all numbers are finite (t_max may be infinite), and no coordinate of
// its origin is beyond 2^60, more than any point on a face and less than where Embree stops
// (1.844e18).
inline bool is_traceable(const Ray& ray) {
  const Vec3d& o = ray.origin;
  // Sums with NaN compare false, and so does the length of a direction that has one.
  return std::fabs(o.x) + std::fabs(o.y) + std::fabs(o.z) <= 0x1p60 &&
         length_squared(ray.direction) <= 2 && ray.t_min >= 0 && ray.t_max >= 0;
}

class RayTracer {
 public:
  virtual ~RayTracer() = default;
  // The first hit in (t_min, t_max); false if none. Faces without area are never met. Thread-safe.
  // Throws UntraceableRay unless is_traceable(ray).
  virtual bool closest(const Ray& ray, Hit& hit) const = 0;
  virtual bool occluded(const Ray& ray) const = 0;
  // Whether two faces lie in one place: with the same corners, or overlapping in a plane
  // (face_overlaps.h).
  virtual bool overlap(FaceRef a, FaceRef b) const = 0;
  // Puts the face that is met (face_overlaps.h) in the place of one that is in the same place where
  // the ray passes: what closest() returns is settled.
  virtual void settle(const Ray& /*ray*/, Hit& /*hit*/) const {}
};

// The scene must outlive the tracer. Far from the origin it traces in coordinates of its own: what
// is met does not depend on where a scene lies, as far as floats hold its positions. InputError
// with Embree's words if it fails (out of memory, unsupported machine).
std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads);
// Every face tested in double precision: the oracle for tests.
std::unique_ptr<RayTracer> make_brute_force_tracer(const Scene& scene);

}  // namespace limn
