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

namespace {

Lanes along(const Vec3<Lanes>& v, const Vec3d& side) {
  return v.x * side.x + v.y * side.y + v.z * side.z;
}

void log_point(const EdgeSample& sample, double distance, SampleLog& log) {
  log.push_back(fmt::format(
      "  edge {} of shape {} at t = {:.6g}: probability {:.4g}, density of t {:.4g}, distance "
      "{:.6g}",
      sample.edge.edge.index(), sample.edge.object.index(), sample.t, sample.probability,
      sample.pdf_t, distance));
}

// Whether a draw of a weight that scatters f is traced: always what weighs much, else by chance,
// and then it counts for those that are not.
bool survives(const PathVertex& vertex, const Rgb<double>& f, const Rng& key, Lanes& weight) {
  double squares = 0;
  for (int k = 0; k < kLanes; ++k) {
    const double w = weight[k] * vertex.survival[k];
    squares += w * w;
  }
  const double probability = std::sqrt(squares) * luminance(vertex.throughput * f);
  if (!(probability < 1)) return true;
  if (key.at(Purpose::kDrawRoulette, vertex.bounces).uniform() >= probability) return false;
  weight = weight * (1 / probability);
  return true;
}

// Of draws that a run would decide on: those that move for a parameter.
void add_traced(const PathVertex& vertex, const Lanes& weight, const Rgb<double>& scattered,
                const RayCount& rays, const Rgb<double>& amount) {
  double moves = 0;
  for (int k = 0; k < vertex.parameters; ++k) moves += std::fabs(weight[k]);
  if (moves == 0) return;
  const double unit = luminance(scattered);
  double squares = 0;
  for (int c = 0; c < 3; ++c) squares += amount[c] * amount[c];
  vertex.traced->add({1, rays.total(), unit > 0 ? squares / (unit * unit) : 0});
}

}  // namespace

void add_edge_point(const PathContext& context, const EdgeMesh& mesh, const PathVertex& vertex,
                    const EdgeQuery& query, const EdgeSample& sample, const RadiancePart& part,
                    const Rng& key, TermCost& cost, Rgb<Lanes>& sum, double share,
                    bool by_roulette) {
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
  Lanes weight = along(v, view.side) * measure;
  if (vertex.log) log_point(sample, view.distance, *vertex.log);
  // A density may round to zero at the very horizon.
  const Rgb<double> f =
      seen && sample.pdf_t > 0 ? vertex.scattering.eval_value(view.omega) : Rgb<double>{};
  if ((is_zero(weight) && !vertex.turned) || is_black(f)) {
    ++cost.zero_weight;
    if (vertex.log) vertex.log->push_back("    no weight");
    return;
  }
  if (by_roulette && !vertex.turned && !is_zero(vertex.survival) &&
      !survives(vertex, f, key, weight)) {
    ++cost.left_out;
    if (vertex.log) vertex.log->push_back("    left out by roulette");
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context, mesh, view, query.face, 0, std::numeric_limits<double>::infinity(),
                vertex.bounces + 1, key, rays, jump, part);
  cost.add(rays);
  const Rgb<double> amount = visible ? vertex.throughput * f * jump : Rgb<double>{};
  if (by_roulette && vertex.traced) add_traced(vertex, weight, vertex.throughput * f, rays, amount);
  if (!visible) {
    ++cost.occluded;
    if (vertex.log) vertex.log->push_back("    hidden");
    return;
  }
  ++cost.counted;
  const Rgb<Lanes> added{weight * amount.r, weight * amount.g, weight * amount.b};
  if (TurnedVertex* turned = vertex.turned) {
    const Vec3<Lanes> moving = turned->velocity * -share - turned->turn.velocity(view.y - query.p);
    const Lanes swept = along(moving, view.side) * measure;
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
