// Draws lines from emitters through edges to what lies behind.
#include "integrators/terms/penumbra_lines.h"

#include <algorithm>

#include "integrators/edges/near_faces.h"
#include "integrators/lights/light_regions.h"

namespace limn {

std::optional<DrawnLine> PenumbraLines::draw(double u, Rng& rng, RayCount& rays) const {
  const EmitterEdges::Drawn emitter_edge = ways_.emitter_edges.draw(u);
  const double t = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
  const EdgeRef id = emitter_edge.edge;
  const EdgeMesh& mesh = ways_.edges.object(id.object);
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const auto omega = ways_.regions.draw_direction(emitter_edge.region, e, u1, u2);
  if (!omega) return {};
  Ray ray{e, -*omega};
  const FacesAround around = mesh.around(id.edge);
  ray.skip_faces = around.all;
  Hit hit;
  ++rays.closest;
  if (!closest_at_edge(context_.tracer, context_.scene, around, e, 0, ray, hit)) return {};
  if (is_lifted(context_.scene, hit.face.shape)) return {};
  const auto corners =
      face_corners<double>(context_.scene.shape(hit.face.shape).mesh, hit.face.face);
  const Vec3d n = normalize(cross(corners[1] - corners[0], corners[2] - corners[0]));
  // More exactly than the ray's floats.
  const Vec3d p = e - *omega * (dot(n, e - corners[0]) / dot(n, *omega));
  return DrawnLine{
      {id, t, emitter_edge.probability, 1}, hit.face, {emitter_edge.region, id, e, p, n}};
}

bool PenumbraLines::complete(DrawnLine& drawn, const PathStep& step, int bounces, Rng& rng,
                             bool scattered) const {
  constexpr double kLeastShare = 0.1;  // lines of less go on by roulette; not tuned
  const PenumbraShare of = penumbra_share(ways_, drawn.line, step, bounces);
  const double share = scattered ? of.scattered : of.share;
  if (!(rng.uniform() * kLeastShare < share)) return false;
  drawn.edge.probability *= of.density / std::max(share, kLeastShare);
  return true;
}

std::optional<SeenVertex> PenumbraLines::scatter(const DrawnLine& drawn, double u_0, double u_1,
                                                 const LensPoint& lens, RayCount& rays) const {
  const auto& [region, edge, e, p, n] = drawn.line;
  const double height = 1 - u_0, radius = std::sqrt(u_0 * (2 - u_0)), angle = 2 * kPi * u_1;
  const Vec3d local{radius * std::cos(angle), radius * std::sin(angle), height};
  Ray ray{p, normalize(Frame(dot(n, e - p) < 0 ? -n : n).to_world(local))};
  ray.start = drawn.face;
  Hit hit;
  ++rays.closest;
  if (!context_.tracer.closest(ray, hit)) return {};
  const auto met = surface_on_ray<double>(context_.scene, hit.face, ray.origin, ray.direction);
  return seen_vertex(context_.scene, hit.face, met.p, lens);
}

PathStep PenumbraLines::step_from(const PathVertex& vertex, const Vec3d& omega) const {
  double pdf = vertex.scattering.pdf_solid_angle(omega);
  if (const MirroredLight* mirrored = context_.mirrored; mirrored && pdf > 0) {
    pdf = MirroredLight::pdf(mirrored->mixture(vertex.surface, vertex.scattering), omega, pdf);
  }
  return {vertex.surface.p, pdf, vertex.surface.face, vertex.step.from};
}

std::optional<SeenLine> PenumbraLines::seen_from(const PathVertex& vertex, const Rng& key,
                                                 TermCost& cost) const {
  ++cost.samples;
  RayCount rays;
  // Not the numbers of the term `shadow` there.
  Rng rng = key.at(Purpose::kShadow, vertex.bounces).at(Purpose::kDirect, 0);
  const double u = rng.uniform();
  auto drawn = draw(u, rng, rays);
  cost.add(rays);
  if (!drawn) {
    ++cost.no_edge;
    return {};
  }
  const Vec3d q = vertex.surface.p;
  const Vec3d to = drawn->line.p - q;
  const double distance = length(to);
  const bool apart = distance > 0 && drawn->face != vertex.surface.face;
  const Vec3d omega = apart ? to / distance : Vec3d{};
  const PathStep step = apart ? step_from(vertex, omega) : PathStep{};
  const Rgb<double> f = step.pdf > 0 ? vertex.scattered(omega) : Rgb<double>{};
  if (is_black(f) || !complete(*drawn, step, vertex.bounces + 1, rng)) {
    ++cost.zero_weight;
    return {};
  }
  if (is_hidden_from(context_, vertex, drawn->face, omega, distance, cost)) {
    ++cost.occluded;
    return {};
  }
  return SeenLine{*drawn, {omega, distance}, f};
}

}  // namespace limn
