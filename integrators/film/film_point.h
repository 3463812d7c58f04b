#pragma once
// Points of the scene as the camera sees them, for terms that find points elsewhere than along the
// camera's rays.
#include <optional>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path.h"

namespace limn {

struct FilmPoint {
  FilmPlace at;
  CameraRay<Dual> ray;  // through it
  Vec3d omega;          // its unit direction
  double distance;      // along it
};

// Where a point of a face is on the film, as seen through this point of a lens, if nothing hides
// it. None where no pixel can use it: outside the film and the filter around it, before or behind
// the clip planes, on an emitter that the camera does not see.
std::optional<FilmPoint> film_point(const Scene& scene, FaceRef face, const Vec3d& x,
                                    const LensPoint& lens);
// The same seen at x, a point nearby.
inline FilmPoint aimed_at(FilmPoint point, const Vec3d& x) {
  const Vec3d way = x - value(point.ray.origin);
  point.distance = length(way);
  point.omega = way / point.distance;
  return point;
}
// The ray through a position on the film and a point of the lens. Its derivatives are those by the
// position alone: per pixel along x in lane 0, and along y in lane 1.
CameraRay<Dual> shifted_ray(const Camera& camera, const FilmPlace& at);
// To the face, as shadow rays end.
Ray ray_to(const Scene& scene, const FilmPoint& point, FaceRef face);
// One shadow ray.
bool is_hidden(const PathContext& context, const FilmPoint& point, FaceRef face, RayCount& rays);

// How much film a direction takes [pixels^2 / sr]. Of an orthographic camera: solid angle as seen
// from the distance along the ray.
double film_per_solid_angle(const Camera& camera, const Vec3d& omega, double distance);

}  // namespace limn
