// One path on the tape. At its vertices edges are drawn as in forward mode, with an importance that
// knows no motion.
#include "integrators/backward/path_adjoint.h"

#include "integrators/backward/edge_adjoint.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// The terms of edges, as the visitor of a path.
class VertexAdjoints {
 public:
  VertexAdjoints(const AdjointContext& context, const Rgb<double>& adjoint, Tape& tape,
                 AdjointCosts& costs)
      : context_(context),
        adjoint_(adjoint * (1.0 / context.edge_samples)),
        tape_(tape),
        costs_(costs) {}

  void operator()(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                  const Rgb<Var>& throughput, const DirectionMotion*, const PathStep& step,
                  int bounces, const Rng& key) {
    const AdjointVertex vertex{surface, scattering, adjoint_ * value(throughput), bounces};
    const EdgeQuery query = query_at(vertex);
    const int max_depth = context_.scene().max_depth;
    const bool scatters_on = max_depth < 0 || bounces + 2 < max_depth;
    const bool regions_alone = context_.regions && context_.regions->regions.hold_all();
    if (context_.sampler && (scatters_on || !regions_alone)) add_edges(vertex, query, key);
    if (context_.direct) add_direct(vertex, query, step, key);
    if (context_.shadows && scatters_on) add_shadows(vertex, key);
    if (context_.penumbra && scatters_on) add_penumbras(vertex, key);
  }

  Seeds& seeds() { return seeds_; }

 private:
  void add_edges(const AdjointVertex& vertex, const EdgeQuery& query, const Rng& key);
  void add_direct(const AdjointVertex& vertex, const EdgeQuery& query, const PathStep& step,
                  const Rng& key);
  void add_shadows(const AdjointVertex& vertex, const Rng& key);
  void add_shadow(const AdjointVertex& vertex, Rng rng);
  void add_penumbras(const AdjointVertex& vertex, const Rng& key);
  void add_penumbra(const AdjointVertex& vertex, const Rng& key);

  const AdjointContext& context_;
  Rgb<double> adjoint_;
  Tape& tape_;
  AdjointCosts& costs_;
  Seeds seeds_;
};

void VertexAdjoints::add_edges(const AdjointVertex& vertex, const EdgeQuery& query,
                               const Rng& key) {
  static thread_local std::vector<std::optional<EdgeSample>> drawn;
  const Stopwatch watch;
  const RadiancePart part = context_.rest();
  TermCost& cost = costs_[kBoundary];
  draw_edges(*context_.sampler, query, key, vertex.bounces, context_.edge_samples, drawn);
  cost.samples += drawn.size();
  for (size_t i = 0; i < drawn.size(); ++i) {
    if (drawn[i]) {
      const Rng own = key.copy(Purpose::kEdgeCopy, static_cast<int>(i));
      add_edge_point(context_, vertex, query, *drawn[i], part, own, 1, tape_, seeds_, cost);
    } else {
      ++cost.no_edge;
    }
  }
  cost.seconds += watch.seconds();
}

void VertexAdjoints::add_direct(const AdjointVertex& vertex, const EdgeQuery& query,
                                const PathStep& step, const Rng& key) {
  static thread_local DirectPieces pieces;
  static thread_local std::vector<DirectPoint> points;
  const Stopwatch watch;
  TermCost& cost = costs_[kDirect];
  const AdjointRegions& r = *context_.regions;
  r.direct.list(query, query, pieces);
  r.direct.draw(pieces, key, vertex.bounces, context_.edge_samples, cost, points);
  for (const DirectPoint& point : points) {
    const double share =
        direct_share(context_.scene(), context_.edges, r.regions, r.lamp_edges, point.sample,
                     point.region, query.p, vertex.surface.n_g, step, vertex.bounces);
    add_edge_point(context_, vertex, query, point.sample, {&r.regions, point.region}, key, share,
                   tape_, seeds_, cost);
  }
  cost.seconds += watch.seconds();
}

void VertexAdjoints::add_penumbras(const AdjointVertex& vertex, const Rng& key) {
  const Stopwatch watch;
  for (int i = 0; i < context_.edge_samples; ++i) {
    add_penumbra(vertex, key.copy(Purpose::kShadowCopy, i));
  }
  costs_[kPenumbra].seconds += watch.seconds();
}

void VertexAdjoints::add_penumbra(const AdjointVertex& vertex, const Rng& key) {
  TermCost& cost = costs_[kPenumbra];
  const auto seen = context_.regions->lines.seen_from(vertex, key, cost);
  if (!seen) return;
  const auto& [drawn, omega, f] = *seen;
  add_penumbra_line(context_, drawn, vertex.surface.p, {omega.x, omega.y, omega.z},
                    vertex.weight * f, vertex.bounces + 1, key, tape_, seeds_, cost);
}

void VertexAdjoints::add_shadows(const AdjointVertex& vertex, const Rng& key) {
  const Stopwatch watch;
  for (int i = 0; i < context_.edge_samples; ++i) {
    add_shadow(vertex, key.copy(Purpose::kShadowCopy, i).at(Purpose::kShadow, vertex.bounces));
  }
  costs_[kShadow].seconds += watch.seconds();
}

void VertexAdjoints::add_shadow(const AdjointVertex& vertex, Rng rng) {
  TermCost& cost = costs_[kShadow];
  ++cost.samples;
  double probability;
  const ShadowEdge& edge = context_.shadows->choose(rng.uniform(), probability);
  RayCount rays;
  const auto point = context_.shadows->cast(edge, rng.uniform(), rays);
  cost.add(rays);
  if (!point) {
    ++cost.occluded;
    return;
  }
  const Vec3d q = value(vertex.surface.p);
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != vertex.surface.face;
  const Rgb<double> f = apart ? vertex.scattering.eval_value(omega) : Rgb<double>{};
  const Rgb<double> amount = is_black(f) ? f : f * context_.shadows->jump(edge, *point, q, omega);
  if (is_black(amount)) {
    ++cost.zero_weight;
    return;
  }
  const Vec3d way = point->target(q) - q;
  if (is_hidden_from(context_.path, vertex, point->face, normalize(way), length(way), cost)) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const Var swept = shadow_sweep(context_, edge, *point, vertex.surface.p,
                                 {omega.x, omega.y, omega.z}, distance, seeds_);
  seeds_.add(swept.node, weighed(vertex.weight, amount) / probability);
}

// The ray through a film position, moving with the camera where that has slots.
CameraRay<Var> moving_ray(const AdjointContext& context, const FilmPosition& film,
                          const CameraRay<double>& ray) {
  if (context.parameters.slots().camera != 0) {
    return camera_leaves(context.scene().camera).ray(film.x, film.y);
  }
  const Vec3d &o = ray.origin, &d = ray.direction;
  return {{o.x, o.y, o.z}, {d.x, d.y, d.z}, ray.t_min, ray.t_max};
}

}  // namespace

bool append_finite(const Tape& tape, std::vector<Contribution>& contributions) {
  const std::vector<Contribution>& list = tape.contributions();
  const bool finite = std::all_of(list.begin(), list.end(),
                                  [](const Contribution& c) { return std::isfinite(c.value); });
  if (finite) contributions.insert(contributions.end(), list.begin(), list.end());
  return finite;
}

bool add_path_adjoint(const AdjointContext& context, int x, int y, const Rng& key,
                      const Rgb<double>& adjoint, Tape& tape, AdjointCosts& costs,
                      std::vector<Contribution>& contributions) {
  tape.clear();
  VertexAdjoints vertices(context, adjoint, tape, costs);
  // As in forward mode: in closed form a path takes two places of its pixel.
  const int places = context.path.closed ? 2 : 1;
  for (int i = 0; i < places; ++i) {
    FilmPosition film = sample_pixel_filter(context.scene().film, context.filter, x, y, key);
    if (i > 0) film = mirrored_in_pixel(context.scene().film, x, y, film);
    const auto still = context.scene().camera.ray<double>(film.x, film.y);
    const auto ray = moving_ray(context, film, still);
    RayCount rays;
    ++costs[kInterior].samples;
    PathTracer<Var, VertexAdjoints> tracer(context.path, rays);
    Walk<Var, VertexAdjoints> walk(key, 0, &vertices);
    const StartRay<Var> start{camera_ray(context.scene(), still), ray.origin, ray.direction};
    tracer.follow_rays({&start, 1}, {&walk, 1});
    const Rgb<Var>& radiance = walk.sums.radiance;
    if (walk.failed || !is_finite(value(radiance))) return false;
    if (context.interior) {
      for (int c = 0; c < 3; ++c) vertices.seeds().add(radiance[c].node, adjoint[c] / places);
    }
    costs[kInterior].add(rays);
  }
  if (!vertices.seeds().empty()) vertices.seeds().sweep(context, tape);
  return append_finite(tape, contributions);
}

}  // namespace limn
