// Lines from points of shadows to vertices that the camera sees.
#include "integrators/terms/shadow_lines.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// The share of lines whose directions follow the lobe.
constexpr double kByLobe = 0.5;

// Directions in which lines leave a point of a shadow.
class LineDirections {
 public:
  LineDirections(const Scene& scene, const ShadowEdge& edge, const ShadowPoint& point) {
    if (is_lifted(scene, point.face.shape)) return;
    const Vec3d way = edge.light->origin().through(point.x), in = normalize(way);
    const auto surface = surface_on_ray<double>(scene, point.face, point.x - way, in);
    const bool behind = dot(surface.n_g, in) > 0;
    normal_ = behind ? -surface.n_g : surface.n_g;
    const Bsdf* bsdf = surface.shape->bsdf->side(!behind);
    if (!bsdf || !bsdf->is_rough()) return;
    leaves_ = true;
    if (!bsdf->is_lambertian()) lobe_.emplace(surface, -in, scene.shading);
  }

  std::optional<Vec3d> draw(double u_0, double u_1) const {
    if (!leaves_) return {};
    if (lobe_ && u_0 < kByLobe) return lobe_->sample(u_0 / kByLobe, u_1);
    if (lobe_) u_0 = (u_0 - kByLobe) / (1 - kByLobe);
    const double radius = std::sqrt(u_0), angle = 2 * kPi * u_1;
    const Vec3d local{radius * std::cos(angle), radius * std::sin(angle), std::sqrt(1 - u_0)};
    return normalize(Frame(normal_).to_world(local));
  }
  // [1/sr]
  double density(const Vec3d& omega) const {
    if (!leaves_) return 0;
    const double by_cosine = std::max(dot(normal_, omega), 0.0) / kPi;
    if (!lobe_) return by_cosine;
    const double by_lobe =
        lobe_->bsdf().pdf_solid_angle(lobe_->normal(), lobe_->wi(), omega, lobe_->at());
    return kByLobe * by_lobe + (1 - kByLobe) * by_cosine;
  }

 private:
  bool leaves_ = false;
  Vec3d normal_;                            // on the side of the light
  std::optional<Scattering<double>> lobe_;  // as the light sees it; none by Lambert's law
};

}  // namespace

std::optional<SeenVertex> ShadowLines::draw(const ShadowEdge& edge, const ShadowPoint& point,
                                            double u_0, double u_1, const LensPoint& lens,
                                            RayCount& rays) const {
  const auto omega = LineDirections(context_.scene, edge, point).draw(u_0, u_1);
  if (!omega) return {};
  Ray ray{point.x, *omega};
  ray.start = point.face;
  Hit hit;
  ++rays.closest;
  if (!context_.tracer.closest(ray, hit)) return {};
  const auto met = surface_on_ray<double>(context_.scene, hit.face, ray.origin, ray.direction);
  return seen_vertex(context_.scene, hit.face, met.p, lens);
}

double ShadowLines::density(const ShadowEdge& edge, const ShadowPoint& point,
                            const SeenVertex& vertex) const {
  const double by_angle =
      LineDirections(context_.scene, edge, point).density(normalize(vertex.q - point.x));
  return by_angle > 0 ? film_density(context_.scene, point.x, by_angle, vertex) : 0;
}

// Of draws at the vertex the density along the shadow is taken for 1 / (pi r), which it has
// nearest to q, and in gloss by the root of the lobe's density more: to know it would take a
// descent.
double ShadowLines::share(const ShadowEdge& edge, double probability, const ShadowPoint& point,
                          const SeenVertex& vertex, double by_line,
                          const Scattering<double>& scattering) const {
  if (!(by_line > 0)) return 0;
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d along = mesh.position(ends[1]) - mesh.position(ends[0]);
  const auto c = face_corners<double>(context_.scene.shape(point.face.shape).mesh, point.face.face);
  const Vec3d n = normalize(cross(c[1] - c[0], c[2] - c[0]));
  // |dx/dt| = m |n x (along x w)|, and m = (|x - l| / |w|) / |n . w|.
  const LightOrigin origin = edge.light->origin();
  const Vec3d w = origin.through(point.x);
  const double ratio = origin.infinite ? 1 : std::sqrt(point.m * std::fabs(dot(n, w)));
  const double speed = point.m * length(cross(n, cross(along, w))) / ratio;
  const Film& film = context_.scene.film;
  const double pixels = static_cast<double>(film.crop_width) * film.crop_height;
  const double lines = kShare * pixels * probability * by_line;
  const Vec3d to = point.x - vertex.q;
  double draws = speed / (kPi * length(to));
  if (!scattering.bsdf().is_lambertian()) {
    draws *= std::sqrt(kPi * scattering.bsdf().pdf_solid_angle(scattering.normal(), scattering.wi(),
                                                               normalize(to), scattering.at()));
  }
  const double quotient = draws / lines;
  return 1 / (1 + quotient * quotient);
}

}  // namespace limn
