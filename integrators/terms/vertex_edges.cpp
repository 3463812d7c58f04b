// What a point on an edge adds at a vertex of a path.
#include "integrators/terms/vertex_edges.h"

#include <fmt/format.h>

#include <limits>

namespace limn {

EdgeQuery query_at(const PathVertex& vertex) {
  const Vec3<Dual>& p = vertex.surface.p;
  EdgeQuery query;
  query.p = value(p);
  query.n = value(vertex.scattering.normal());
  query.wi = value(vertex.scattering.wi());
  query.lobe = vertex.scattering.bsdf().lobe();
  query.velocity = {p.x.d, p.y.d, p.z.d};
  query.turn = vertex.turn;
  query.face = vertex.surface.face;
  return query;
}

Vec3<Dual> moving_direction(const PathVertex& vertex, const Vec3d& omega, const Rng& key,
                            TermCost& cost) {
  if (!vertex.warp) return turning(omega, vertex.turn);
  RayCount rays;
  DirectionWarper warper(*vertex.warp, rays);
  const DirectionMotion* motion = warper.motion(vertex.surface, omega, key);
  cost.add(rays);
  return motion ? warped(omega, *motion->warp) : turning(omega, {});
}

void draw_edges(const EdgeSampler& sampler, const EdgeQuery& query, const Rng& key, int bounces,
                int count, std::vector<std::optional<EdgeSample>>& drawn) {
  static thread_local std::vector<Rng> rngs;
  rngs.clear();
  for (int i = 0; i < count; ++i) {
    rngs.push_back(key.copy(Purpose::kEdgeCopy, i).at(Purpose::kEdge, bounces));
  }
  sampler.sample_several(query, rngs, drawn);
}

void add_edge_point(const PathContext& context, const EdgeMesh& mesh, const PathVertex& vertex,
                    const EdgeQuery& query, const EdgeSample& sample, const RadiancePart& part,
                    const Rng& key, TermCost& cost, Rgb<Lanes>& sum, double share) {
  EdgeView view;
  const bool seen = view_edge(mesh, sample.edge, sample.t, query.p, view);
  const auto [a, b] = mesh.edge(sample.edge.edge).vertices;
  Vec3<Lanes> v = relative_velocity(mesh, a, query) * (1 - sample.t) +
                  relative_velocity(mesh, b, query) * sample.t;
  if (share != 1) v = v * share - query.turn.velocity(view.y - query.p) * (1 - share);
  if (seen && vertex.warp) {
    const Rng rng = key.at(Purpose::kEdge, vertex.bounces).at(Purpose::kEdge, 1);
    const Vec3<Dual> w = moving_direction(vertex, view.omega, rng, cost);
    v = v - Vec3<Lanes>{w.x.d, w.y.d, w.z.d} * view.distance;
  }
  const double measure =
      1 / (view.distance * view.distance * view.distance * sample.probability * sample.pdf_t);
  const Lanes weight = (v.x * view.side.x + v.y * view.side.y + v.z * view.side.z) * measure;
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "  edge {} of shape {} at t = {:.6g}: probability {:.4g}, density of t {:.4g}, distance "
        "{:.6g}",
        sample.edge.edge.index(), sample.edge.object.index(), sample.t, sample.probability,
        sample.pdf_t, view.distance));
  }
  // A density may round to zero at the very horizon.
  const Rgb<double> f =
      seen && sample.pdf_t > 0 ? vertex.scattering.eval_value(view.omega) : Rgb<double>{};
  if ((is_zero(weight) && !vertex.turned) || is_black(f)) {
    ++cost.zero_weight;
    if (vertex.log) vertex.log->push_back("    no weight");
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context, mesh, view, query.face, 0, std::numeric_limits<double>::infinity(),
                vertex.bounces + 1, key, rays, jump, part);
  cost.add(rays);
  if (!visible) {
    ++cost.occluded;
    if (vertex.log) vertex.log->push_back("    hidden");
    return;
  }
  ++cost.counted;
  const Rgb<double> amount = vertex.throughput * f * jump;
  const Rgb<Lanes> added{weight * amount.r, weight * amount.g, weight * amount.b};
  if (TurnedVertex* turned = vertex.turned) {
    const Vec3<Lanes> moving = turned->velocity * -share - turned->turn.velocity(view.y - query.p);
    const Lanes swept =
        (moving.x * view.side.x + moving.y * view.side.y + moving.z * view.side.z) * measure;
    for (int c = 0; c < 3; ++c) turned->sum[c] += swept * amount[c];
  }
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "    jump ({:.6g}, {:.6g}, {:.6g}), adds ({:.6g}, {:.6g}, {:.6g}) to the first parameter",
        jump.r, jump.g, jump.b, added.r[0], added.g[0], added.b[0]));
  }
  sum = sum + added;
}

}  // namespace limn
