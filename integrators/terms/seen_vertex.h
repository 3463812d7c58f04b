#pragma once
// A first vertex of a path, as lines from elsewhere find it.
#include <cmath>
#include <optional>

#include "integrators/film/film_point.h"
#include "limn/core/surface_point.h"

namespace limn {

// A point q of a face, and where the camera sees it through a point of its lens.
struct SeenVertex {
  FaceRef face;
  Vec3d q;
  FilmPoint seen;
};

// A vertex that lines may find, if it is one: rays leave surfaces with interpolated normals above
// their faces (surface_point.h), where lines do not end.
inline std::optional<SeenVertex> seen_vertex(const Scene& scene, FaceRef face, const Vec3d& q,
                                             const LensPoint& lens) {
  if (is_lifted(scene, face.shape)) return {};
  const auto seen = film_point(scene, face, q, lens);
  if (!seen) return {};
  return SeenVertex{face, q, *seen};
}

// The density on the film [1 / pixel^2] of a vertex q of a face that is met by lines from x.
// by_angle: that of their directions at x [1/sr]. sight: from where the camera's ray starts to q.
inline double film_density(const Scene& scene, const Vec3d& x, double by_angle, FaceRef face,
                           const Vec3d& q, const Vec3d& sight) {
  const auto c = face_corners<double>(scene.shape(face.shape).mesh, face.face);
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]), way = q - x;
  const double distance = length(sight), r2 = length_squared(way);
  const Vec3d omega = sight / distance;
  return by_angle * std::fabs(dot(n, way)) / (std::sqrt(r2) * r2) * distance * distance /
         (std::fabs(dot(n, omega)) * film_per_solid_angle(scene.camera, omega, distance));
}
inline double film_density(const Scene& scene, const Vec3d& x, double by_angle,
                           const SeenVertex& vertex) {
  return film_density(scene, x, by_angle, vertex.face, vertex.q,
                      vertex.seen.omega * vertex.seen.distance);
}

}  // namespace limn
