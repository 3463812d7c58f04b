// Draws lines from emitters through edges to what lies behind.
#include "integrators/terms/penumbra_lines.h"

#include <algorithm>

#include "integrators/edges/near_faces.h"
#include "integrators/lights/light_regions.h"

namespace limn {

std::optional<DrawnLine> PenumbraLines::draw(double u, Rng& rng, RayCount& rays) const {
  const EmitterEdges::Drawn emitter_edge = emitter_edges_.draw(u);
  const double t = rng.uniform(), u1 = rng.uniform(), u2 = rng.uniform();
  const EdgeRef id = emitter_edge.edge;
  const EdgeMesh& mesh = edges_.object(id.object);
  const auto& ends = mesh.edge(id.edge).vertices;
  const Vec3d e = mesh.position(ends[0]) * (1 - t) + mesh.position(ends[1]) * t;
  const auto omega = regions_.draw_direction(emitter_edge.region, e, u1, u2);
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

bool PenumbraLines::complete(DrawnLine& drawn, const PathStep& step, int bounces, Rng& rng) const {
  constexpr double kLeastShare = 0.1;  // lines of less go on by roulette; not tuned
  const auto [density, share] =
      penumbra_share({context_.scene, edges_, regions_, emitter_edges_}, drawn.line, step, bounces);
  if (!(rng.uniform() * kLeastShare < share)) return false;
  drawn.edge.probability *= density / std::max(share, kLeastShare);
  return true;
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
  double pdf = apart ? vertex.scattering.pdf_solid_angle(omega) : 0;
  if (const MirroredLight* mirrored = context_.mirrored; mirrored && pdf > 0) {
    pdf = MirroredLight::pdf(mirrored->mixture(vertex.surface, vertex.scattering), omega, pdf);
  }
  const Rgb<double> f = pdf > 0 ? vertex.scattered(omega) : Rgb<double>{};
  if (is_black(f) || !complete(*drawn, {q, pdf}, vertex.bounces + 1, rng)) {
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
