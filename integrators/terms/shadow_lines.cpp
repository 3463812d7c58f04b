// Lines from points of shadows to vertices that the camera sees.
#include "integrators/terms/shadow_lines.h"

#include <cmath>

namespace limn {

Vec3d ShadowLines::normal(FaceRef face) const {
  const auto c = face_corners<double>(context_.scene.shape(face.shape).mesh, face.face);
  return normalize(cross(c[1] - c[0], c[2] - c[0]));
}

std::optional<SeenVertex> ShadowLines::draw(const ShadowEdge& edge, const ShadowPoint& point,
                                            double u_0, double u_1, const LensPoint& lens,
                                            RayCount& rays) const {
  if (is_lifted(context_.scene, point.face.shape)) return {};
  const Vec3d n = normal(point.face);
  const bool behind = dot(n, edge.light->origin().through(point.x)) > 0;
  const double radius = std::sqrt(u_0), angle = 2 * kPi * u_1;
  const Vec3d local{radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - u_0)};
  Ray ray{point.x, normalize(Frame(behind ? -n : n).to_world(local))};
  ray.start = point.face;
  Hit hit;
  ++rays.closest;
  if (!context_.tracer.closest(ray, hit)) return {};
  const auto met = surface_on_ray<double>(context_.scene, hit.face, ray.origin, ray.direction);
  return seen_vertex(context_.scene, hit.face, met.p, lens);
}

double ShadowLines::density(const ShadowEdge& edge, const ShadowPoint& point,
                            const SeenVertex& vertex) const {
  if (is_lifted(context_.scene, point.face.shape)) return 0;
  const Vec3d n = normal(point.face), way = vertex.q - point.x;
  const double height = dot(n, way);
  // Lines leave x on the side that is lit.
  if (!(height * dot(n, edge.light->origin().through(point.x)) < 0)) return 0;
  const double by_angle = std::fabs(height) / (kPi * std::sqrt(length_squared(way)));
  return film_density(context_.scene, point.x, by_angle, vertex);
}

// Of draws at the vertex the density along the shadow is taken for 1 / (pi r), which it has
// nearest to q: to know it would take a descent.
double ShadowLines::share(const ShadowEdge& edge, double probability, const ShadowPoint& point,
                          const SeenVertex& vertex) const {
  const double by_line = density(edge, point, vertex);
  if (!(by_line > 0)) return 0;
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d along = mesh.position(ends[1]) - mesh.position(ends[0]), n = normal(point.face);
  // |dx/dt| = m |n x (along x w)|, and m = (|x - l| / |w|) / |n . w|.
  const LightOrigin origin = edge.light->origin();
  const Vec3d w = origin.through(point.x);
  const double ratio = origin.infinite ? 1 : std::sqrt(point.m * std::fabs(dot(n, w)));
  const double speed = point.m * length(cross(n, cross(along, w))) / ratio;
  const Film& film = context_.scene.film;
  const double pixels = static_cast<double>(film.crop_width) * film.crop_height;
  const double lines = kShare * pixels * probability * by_line;
  const double draws = speed / (kPi * length(vertex.q - point.x));
  const double quotient = draws / lines;
  return 1 / (1 + quotient * quotient);
}

}  // namespace limn
