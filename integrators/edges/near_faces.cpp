// Faces near to an edge, met by lines through a point of it.
#include "integrators/edges/near_faces.h"

#include <optional>

#include "limn/core/shading.h"

namespace limn {
namespace {

// Where the line t d meets the triangle: the volumes over its sides and d have one sign.
std::optional<double> meet(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
  const double u = dot(cross(b, c), d), v = dot(cross(c, a), d), w = dot(cross(a, b), d);
  const bool left = u >= 0 && v >= 0 && w >= 0, right = u <= 0 && v <= 0 && w <= 0;
  const Vec3d n = cross(b - a, c - a);
  const double slope = dot(n, d);
  if (!(left || right) || slope == 0) return std::nullopt;
  return dot(n, a) / slope;
}

// The first near face that the ray meets between distances from y.
std::optional<Hit> meet_near_faces(const Scene& scene, const FacesAround& around, const Vec3d& y,
                                   const Ray& ray, double from, double to) {
  std::optional<Hit> first;
  for (const FaceRef face : around.near) {
    const Shape& shape = scene.shape(face.shape);
    if (face == ray.start || face == ray.end || (ray.skip_emitters && shape.is_emitter)) continue;
    const auto corners = face_corners<double>(shape.mesh, face.face);
    const auto t = meet(corners[0] - y, corners[1] - y, corners[2] - y, ray.direction);
    if (t && *t > from && *t < (first ? first->t : to)) first = Hit{face, *t};
  }
  return first;
}

// closest_at_edge by two rays that start at y, back to the ray's origin and on.
bool closest_from_edge(const RayTracer& tracer, const Scene& scene, const FacesAround& around,
                       const Vec3d& y, double distance, const Ray& ray, Hit& hit) {
  Ray back = ray;
  back.origin = y;
  back.direction = -ray.direction;
  back.t_min = 0;
  back.t_max = (distance - ray.t_min) * (1 - 0x1p-20);  // as shadow rays end
  if (occluded_from_edge(tracer, scene, around, back)) {
    hit = {{}, 0};
    return true;
  }
  Ray on = ray;
  on.origin = y;
  on.t_min = 0;
  on.t_max = ray.t_max - distance;
  if (!closest_at_edge(tracer, scene, around, y, 0, on, hit)) return false;
  hit.t += distance;
  return true;
}

}  // namespace

bool closest_at_edge(const RayTracer& tracer, const Scene& scene, const FacesAround& around,
                     const Vec3d& y, double distance, const Ray& ray, Hit& hit) {
  // Near faces are those that rays from the camera, or from no farther away, cannot tell.
  const Camera& camera = scene.camera;
  if (distance > length(y - value(camera.origin)) + camera.aperture_radius.v &&
      distance > ray.t_min && distance < ray.t_max)
    return closest_from_edge(tracer, scene, around, y, distance, ray, hit);
  const bool found = tracer.closest(ray, hit);
  if (around.near.empty()) return found;
  const double to = (found ? hit.t : ray.t_max) - distance;
  auto near = meet_near_faces(scene, around, y, ray, ray.t_min - distance, std::min(to, 0.0));
  if (!near) near = meet_near_faces(scene, around, y, ray, 0, to);
  if (near) {
    hit = {near->face, near->t + distance};
    tracer.settle(ray, hit);
  }
  return found || near;
}

bool occluded_from_edge(const RayTracer& tracer, const Scene& scene, const FacesAround& around,
                        const Ray& ray) {
  if (tracer.occluded(ray)) return true;
  return !around.near.empty() &&
         meet_near_faces(scene, around, ray.origin, ray, ray.t_min, ray.t_max);
}

}  // namespace limn
