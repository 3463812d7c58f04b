#pragma once
// Rays against the triangles of a scene.
#include <array>
#include <cstdint>
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
  // Faces that the ray never meets: the one it starts on, the one it ends on, and those around an edge
  // that it grazes. By id, never by distance.
  FaceRef start = {};
  FaceRef end = {};
  std::span<const FaceRef> skip_faces = {};
  bool skip_emitters = false;  // hide_emitters, for camera rays
};

struct Hit {
  FaceRef face;
  double t = 0;
};

class RayTracer {
 public:
  virtual ~RayTracer() = default;
  // The first hit in (t_min, t_max); false if none. Thread-safe.
  virtual bool closest(const Ray& ray, Hit& hit) const = 0;
  virtual bool occluded(const Ray& ray) const = 0;
};

// The scene must outlive the tracer. Far from the origin it traces in coordinates of its own: what is
// met does not depend on where a scene lies, as far as floats hold its positions. InputError with Embree's words if it fails (out of memory,
// unsupported machine).
std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads);
// Every face tested in double precision: the oracle for tests.
std::unique_ptr<RayTracer> make_brute_force_tracer(const Scene& scene);

}  // namespace limn
