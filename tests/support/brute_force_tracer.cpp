// Brute-force ray tracing in double precision: the reference for Embree.
#include "support/brute_force_tracer.h"

#include <algorithm>

#include "limn/core/face_overlaps.h"

namespace limn {
namespace {

// Distance along the ray to the triangle; negative for a miss. Uses the determinants of Moeller and
// Trumbore 1997.
double intersect(const Ray& ray, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d e1 = b - a;
  const Vec3d e2 = c - a;
  const Vec3d h = cross(ray.direction, e2);
  const double det = dot(e1, h);
  if (det == 0) return -1;
  const Vec3d s = ray.origin - a;
  const double u = dot(s, h) / det;
  const Vec3d q = cross(s, e1);
  const double v = dot(ray.direction, q) / det;
  if (u < 0 || v < 0 || u + v > 1) return -1;
  return dot(e2, q) / det;
}

class BruteForceTracer final : public RayTracer {
 public:
  explicit BruteForceTracer(const Scene& scene)
      : scene_(scene), copies_(scene), overlaps_(scene, copies_, 1) {}

  bool closest(const Ray& ray, Hit& hit) const override {
    if (!is_traceable(ray)) throw UntraceableRay();
    bool found = false;
    double nearest = ray.t_max;
    for (uint32_t s = 0; s < scene_.shapes.size(); ++s) {
      if (ray.skip_emitters && scene_.shapes[s].is_emitter) continue;
      const Mesh& mesh = scene_.shapes[s].mesh;
      for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        const FaceRef face{ShapeId(s), FaceId(f)};
        if (is_skipped(ray, face) || !has_area(mesh, mesh.faces[f])) continue;
        const auto corner = [&](int k) { return cast<double>(mesh.positions[mesh.faces[f][k]]); };
        const double t = intersect(ray, corner(0), corner(1), corner(2));
        if (t < 0 || t <= ray.t_min || t >= nearest) continue;
        nearest = t;
        hit = {face, t};
        found = true;
      }
    }
    return found;
  }

  bool occluded(const Ray& ray) const override {
    Hit hit;
    return closest(ray, hit);
  }

  bool overlap(FaceRef a, FaceRef b) const override { return overlaps_.contains(a, b); }

 private:
  static bool is_skipped(const Ray& ray, FaceRef face) {
    if (face == ray.start || face == ray.end) return true;
    return std::find(ray.skip_faces.begin(), ray.skip_faces.end(), face) != ray.skip_faces.end();
  }

  const Scene& scene_;
  DuplicateFaces copies_;
  FaceOverlaps overlaps_;
};

}  // namespace

std::unique_ptr<RayTracer> make_brute_force_tracer(const Scene& scene) {
  return std::make_unique<BruteForceTracer>(scene);
}

}  // namespace limn
