// Lines from edges of glossy faces to vertices that the camera sees.
#include "integrators/terms/gloss_lines.h"

#include <algorithm>
#include <span>
#include <utility>

#include "integrators/edges/near_faces.h"

namespace limn {
namespace {

// The widest lobe of a face that is listed. Not tuned.
constexpr double kGlossy = 0.35;

bool is_static(const EdgeMesh& mesh, const Edge& edge) {
  return mesh.tangents.empty() || std::ranges::all_of(edge.vertices, [&](VertexId v) {
           const Vec3<Lanes>& tangent = mesh.tangent(v);
           return is_zero(tangent.x) && is_zero(tangent.y) && is_zero(tangent.z);
         });
}

bool is_glossy(const Bsdf* bsdf) {
  return bsdf && bsdf->is_rough() && bsdf->lobe().model->width(bsdf->lobe()) < kGlossy;
}

}  // namespace

GlossLines::GlossLines(const PathContext& context, const EdgeSamplerInput& edges, bool free)
    : context_(context), edges_(edges) {
  const bool all = free || !CameraView<Dual>(context.scene.camera).is_constant();
  for (uint32_t o = 0; o < edges.objects.size(); ++o) list(ShapeId(o), all);
}

// By length and light, as much by what the face scatters of it as by what passes it: grazing light
// goes on to where it is seen at grazing angles.
void GlossLines::list(ShapeId object, bool all) {
  const Scene& scene = context_.scene;
  const EdgeMesh& mesh = edges_.object(object);
  if (!mesh.shape.valid() || mesh.of_texture()) return;
  const Shape& shape = scene.shape(mesh.shape);
  if (shape.is_emitter || is_lifted(scene, mesh.shape)) return;
  if (!is_glossy(shape.bsdf->side(true)) && !is_glossy(shape.bsdf->side(false))) return;
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    const Edge& edge = mesh.edges[e];
    if (!all && is_static(mesh, edge)) continue;
    const Vec3d x0 = mesh.position(edge.vertices[0]), x1 = mesh.position(edge.vertices[1]);
    for (const FaceId face : edge.faces) {
      if (!face.valid()) continue;
      for (const auto& light : scene.delta_lights) {
        const auto arrival = light->arriving(0.5 * (x0 + x1));
        if (!arrival) continue;
        const double cosine = dot(mesh.plane(face).n, arrival->wo);
        const double weight =
            luminance(arrival->irradiance) * (1 + std::fabs(cosine)) * length(x1 - x0);
        if (!(weight > 0) || !is_glossy(shape.bsdf->side(cosine > 0))) continue;
        lit_.push_back({{object, EdgeId(e)}, face, light.get()});
        choice_.add(weight);
      }
    }
  }
}

Vec3d GlossLines::position(EdgeRef edge, double t) const {
  const EdgeMesh& mesh = edges_.object(edge.object);
  const auto& ends = mesh.edge(edge.edge).vertices;
  return mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
}

std::optional<Scattering<double>> GlossLines::at(const Lit& lit, const Vec3d& x) const {
  const EdgeMesh& mesh = edges_.object(lit.edge.object);
  const auto arrival = lit.light->arriving(x);
  if (!arrival) return {};
  const Vec3d n = mesh.plane(lit.face).n;
  const auto surface = surface_on_ray<double>(context_.scene, {mesh.shape, lit.face}, x + n, -n);
  Scattering<double> scattering(surface, arrival->wo, context_.scene.shading);
  if (scattering.black() || !scattering.is_rough()) return {};
  return scattering;
}

std::optional<GlossLines::Line> GlossLines::draw(double u, Rng& rng, const LensPoint& lens,
                                                 RayCount& rays) const {
  const Lit& lit = lit_[choice_.sample(u).index];
  const double t = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
  const Vec3d x = position(lit.edge, t);
  const auto scattering = at(lit, x);
  const auto omega = scattering ? scattering->sample(u1, u2) : std::nullopt;
  if (!omega) return {};
  Ray ray{x, *omega};
  const FacesAround around = edges_.object(lit.edge.object).around(lit.edge.edge);
  ray.skip_faces = around.all;
  Hit hit;
  ++rays.closest;
  if (!closest_at_edge(context_.tracer, context_.scene, around, x, 0, ray, hit)) return {};
  const auto met = surface_on_ray<double>(context_.scene, hit.face, x, *omega);
  const auto vertex = seen_vertex(context_.scene, hit.face, met.p, lens);
  if (!vertex) return {};
  return Line{lit.edge, t, *vertex};
}

// Of draws at the vertex the density along the edge is taken for 1 / (pi r), which it has nearest
// to q: to know it would take a descent.
GlossLines::Share GlossLines::share(const Line& line) const {
  const auto key = [](EdgeRef edge) { return std::pair(edge.object.index(), edge.edge.index()); };
  const auto of_lit = [&](const Lit& lit) { return key(lit.edge); };
  const std::span<const Lit> same(std::ranges::lower_bound(lit_, key(line.edge), {}, of_lit),
                                  std::ranges::upper_bound(lit_, key(line.edge), {}, of_lit));
  if (same.empty()) return {};
  const Vec3d x = position(line.edge, line.t), way = line.vertex.q - x;
  const double r = length(way);
  double by_angle = 0;
  for (const Lit& lit : same) {
    const auto scattering = at(lit, x);
    if (!scattering) continue;
    by_angle += choice_.probability(static_cast<size_t>(&lit - lit_.data())) *
                scattering->bsdf().pdf_solid_angle(scattering->normal(), scattering->wi(), way / r,
                                                   scattering->at());
  }
  if (!(by_angle > 0)) return {};
  const Film& film = context_.scene.film;
  const double density = film_density(context_.scene, x, by_angle, line.vertex);
  const double lines = static_cast<double>(film.crop_width) * film.crop_height * density;
  const auto& ends = edges_.object(line.edge.object).edge(line.edge.edge).vertices;
  const EdgeMesh& mesh = edges_.object(line.edge.object);
  const double draws = length(mesh.position(ends[1]) - mesh.position(ends[0])) / (kPi * r);
  const double ratio = draws / lines;
  return {density, 1 / (1 + ratio * ratio)};
}

}  // namespace limn
