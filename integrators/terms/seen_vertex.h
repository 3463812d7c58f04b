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

// The density on the film [1 / pixel^2] of a vertex that is met by lines from x. by_angle: that of
// their directions at x [1/sr].
inline double film_density(const Scene& scene, const Vec3d& x, double by_angle,
                           const SeenVertex& vertex) {
  const auto c = face_corners<double>(scene.shape(vertex.face.shape).mesh, vertex.face.face);
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]), way = vertex.q - x;
  const FilmPoint& seen = vertex.seen;
  const double r2 = length_squared(way), cosine = std::fabs(dot(n, way)) / std::sqrt(r2);
  return by_angle * cosine / r2 * seen.distance * seen.distance /
         (std::fabs(dot(n, seen.omega)) *
          film_per_solid_angle(scene.camera, seen.omega, seen.distance));
}

}  // namespace limn
