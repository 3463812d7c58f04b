#pragma once
// Ray tracing: closest hits and occlusion for the triangles of a scene.
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

struct Ray {
  Vec3d origin;
  Vec3d direction;  // unit
  double t_min = 0;
  double t_max = std::numeric_limits<double>::infinity();
  // Faces that the ray ignores: the faces of its start and end points, and those around a grazed
  // edge. Identified by id, never by distance.
  FaceRef start = {};
  FaceRef end = {};
  std::span<const FaceRef> skip_faces = {};
  bool skip_emitters = false;  // for camera rays with hide_emitters
};

struct Hit {
  FaceRef face;
  double t = 0;
};

// A ray that is traced together with others, and what comes of it.
struct RayQuery {
  Ray ray;
  Vec3d normal;         // of the face ray.start, if there is one; unit, of either sign
  bool found = false;   // a hit, or that there is something in between
  bool failed = false;  // the ray cannot be traced
  Hit hit;              // set where one is looked for and found
};

// Thrown for a ray that cannot be traced. The sample is then counted and reported as non-finite.
// Returning a miss instead would hide the error.
class UntraceableRay final : public std::exception {
 public:
  const char* what() const noexcept override {
    return "a ray is not finite or starts too far away";
  }
};

// True if Embree can trace the ray: all numbers are finite (t_max may be infinite), and the
// origin's coordinates are within 2^60. That exceeds any point on a face and is below Embree's own
// limit (1.844e18).
inline bool is_traceable(const Ray& ray) {
  const Vec3d& o = ray.origin;
  // A sum with NaN compares false, as does the length of a direction with NaN.
  return std::fabs(o.x) + std::fabs(o.y) + std::fabs(o.z) <= 0x1p60 &&
         length_squared(ray.direction) <= 2 && ray.t_min >= 0 && ray.t_max >= 0;
}

class RayTracer {
 public:
  virtual ~RayTracer() = default;
  // Finds the closest hit in (t_min, t_max); returns false for a miss. Degenerate faces are never
  // hit. Thread-safe. Throws UntraceableRay unless is_traceable(ray).
  virtual bool closest(const Ray& ray, Hit& hit) const = 0;
  virtual bool occluded(const Ray& ray) const = 0;
  // The same for several rays, in less time. Results do not depend on other rays, but for the face
  // met exactly at an edge. A ray starts above the face ray.start by a few roundings of its origin.
  static constexpr size_t kTogether = 8;
  virtual void closest_each(std::span<RayQuery> queries) const;
  virtual void occluded_each(std::span<RayQuery> queries) const;
  // True if two faces are duplicates or overlap in a plane
  // (face_overlaps.h).
  virtual bool overlap(FaceRef a, FaceRef b) const = 0;
  // Replaces a hit by the duplicate or coplanar face that the rule selects (face_overlaps.h). Hits
  // from closest() already follow the rule.
  virtual void settle(const Ray& /*ray*/, Hit& /*hit*/) const {}
};

// Makes a tracer over Embree; the scene must outlive it. Scenes far from the origin are traced in
// local coordinates, so that hits do not depend on their location, within the precision of float
// positions. InputError with Embree's message if it fails (out of memory, unsupported machine).
std::unique_ptr<RayTracer> make_embree_tracer(const Scene& scene, int threads);

struct FirstHit {
  FaceRef face;    // none for a miss
  double t = 0;    // distance from the origin [scene units]; infinite for a miss
  Vec3d normal;    // of the face, unit, on its outer side
  double uv[2]{};  // barycentric: position = (1 - u - v) a + u b + v c of the face's corners
};

// The closest hit of each ray, from distance 0 on; directions need not be unit. Builds a ray
// tracer. InputError for other counts, and for a ray that is not finite or has no direction, by its
// index.
std::vector<FirstHit> first_hits(const Scene& scene, const std::vector<Vec3d>& origins,
                                 const std::vector<Vec3d>& directions, int threads);

}  // namespace limn
