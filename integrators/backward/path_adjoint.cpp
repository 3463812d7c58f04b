// One path on the tape. At its vertices edges are drawn as in forward mode, with an importance that
// knows no motion: the vertices of all that moves have unit tangents along the axes, the shading
// point their opposites, if it moves, so that an edge never seems to rest beside it.
#include "integrators/backward/path_adjoint.h"

#include <limits>

#include "integrators/terms/camera_path.h"
#include "integrators/terms/edge_jump.h"
#include "integrators/terms/path_follow.h"

namespace limn {
namespace {

double weighed(const Rgb<double>& adjoint, const Rgb<double>& value) {
  return adjoint.r * value.r + adjoint.g * value.g + adjoint.b * value.b;
}

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
                  const Rgb<Var>& throughput, const DirectionMotion*, const PathStep&, int bounces,
                  const Rng& key) {
    const Rgb<double> weight = adjoint_ * value(throughput);
    if (context_.sampler) add_edges(surface, scattering, weight, bounces, key);
    const int max_depth = context_.scene().max_depth;
    if (context_.shadows && (max_depth < 0 || bounces + 2 < max_depth)) {
      add_shadows(surface, scattering, weight, bounces, key);
    }
  }

  Seeds& seeds() { return seeds_; }

 private:
  void add_edges(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                 const Rgb<double>& weight, int bounces, const Rng& key);
  void add_edge(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                const Rgb<double>& weight, const EdgeQuery& query, int bounces, const Rng& key);
  void add_shadows(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                   const Rgb<double>& weight, int bounces, const Rng& key);
  void add_shadow(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                  const Rgb<double>& weight, Rng rng);

  const AdjointContext& context_;
  Rgb<double> adjoint_;
  Tape& tape_;
  AdjointCosts& costs_;
  Seeds seeds_;
};

void VertexAdjoints::add_edges(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                               const Rgb<double>& weight, int bounces, const Rng& key) {
  const Stopwatch watch;
  EdgeQuery query;
  query.p = value(surface.p);
  query.n = value(scattering.normal());
  query.wi = value(scattering.wi());
  query.lobe = scattering.bsdf().lobe();
  if (!is_still(surface.p)) query.velocity = {{-1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}};
  query.face = surface.face;
  for (int i = 0; i < context_.edge_samples; ++i) {
    add_edge(surface, scattering, weight, query, bounces, key.copy(Purpose::kEdgeCopy, i));
  }
  costs_[kBoundary].seconds += watch.seconds();
}

// The velocity v of the edge's point, less that of p, sweeps over directions at the rate
// v . side / |w|^3.
void VertexAdjoints::add_edge(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                              const Rgb<double>& weight, const EdgeQuery& query, int bounces,
                              const Rng& key) {
  TermCost& cost = costs_[kBoundary];
  ++cost.samples;
  Rng rng = key.at(Purpose::kEdge, bounces);
  const std::optional<EdgeSample> drawn = context_.sampler->sample(query, rng);
  if (!drawn) {
    ++cost.no_edge;
    return;
  }
  const EdgeMesh& mesh = context_.edges.object(drawn->edge.object);
  EdgeView view;
  const bool seen = view_edge(mesh, drawn->edge, drawn->t, query.p, view);
  const bool moves = context_.motion.moves(drawn->edge) || !is_still(surface.p);
  const Rgb<double> f =
      seen && moves && drawn->pdf_t > 0 ? scattering.eval_value(view.omega) : Rgb<double>{};
  if (is_black(f)) {
    ++cost.zero_weight;
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context_.path, mesh, view, query.face, 0, std::numeric_limits<double>::infinity(),
                bounces + 1, key, rays, jump);
  cost.add(rays);
  if (!visible) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const double measure =
      1 / (view.distance * view.distance * view.distance * drawn->probability * drawn->pdf_t);
  const Vec3d g = view.side * (weighed(weight, f * jump) * measure);
  if (g == Vec3d{}) return;
  if (context_.motion.moves(drawn->edge)) {
    context_.motion.contribute_point(tape_, drawn->edge, drawn->t, g);
  }
  seeds_.add(surface.p, -g);
}

void VertexAdjoints::add_shadows(const SurfacePoint<Var>& surface,
                                 const Scattering<Var>& scattering, const Rgb<double>& weight,
                                 int bounces, const Rng& key) {
  const Stopwatch watch;
  for (int i = 0; i < context_.edge_samples; ++i) {
    add_shadow(surface, scattering, weight,
               key.copy(Purpose::kShadowCopy, i).at(Purpose::kShadow, bounces));
  }
  costs_[kShadow].seconds += watch.seconds();
}

void VertexAdjoints::add_shadow(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                                const Rgb<double>& weight, Rng rng) {
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
  const Vec3d q = value(surface.p);
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != surface.face;
  const Rgb<double> f = apart ? scattering.eval_value(omega) : Rgb<double>{};
  const Rgb<double> amount = is_black(f) ? f : f * context_.shadows->jump(edge, *point, q, omega);
  if (is_black(amount)) {
    ++cost.zero_weight;
    return;
  }
  Ray ray{q, omega};
  ray.start = surface.face;
  ray.end = point->face;
  ray.t_max = distance * (1 - 0x1p-20);  // as shadow rays end
  cost.add(RayCount{0, 1});
  if (context_.path.tracer.occluded(ray)) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const Var swept = shadow_sweep(context_, edge, *point, surface.p, {omega.x, omega.y, omega.z},
                                 distance, seeds_);
  seeds_.add(swept.node, weighed(weight, amount) / probability);
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
  const FilmPosition film = sample_pixel_filter(context.scene().film, x, y, key);
  const auto still = context.scene().camera.ray<double>(film.x, film.y);
  const auto ray = moving_ray(context, film, still);
  RayCount rays;
  ++costs[kInterior].samples;
  VertexAdjoints vertices(context, adjoint, tape, costs);
  PathTracer<Var, VertexAdjoints> tracer(context.path, rays);
  Walk<Var, VertexAdjoints> walk(key, 0, &vertices);
  const StartRay<Var> start{camera_ray(context.scene(), still), ray.origin, ray.direction};
  tracer.follow_rays({&start, 1}, {&walk, 1});
  const Rgb<Var>& radiance = walk.sums.radiance;
  if (walk.failed || !is_finite(value(radiance))) return false;
  if (context.interior) {
    for (int c = 0; c < 3; ++c) vertices.seeds().add(radiance[c].node, adjoint[c]);
  }
  costs[kInterior].add(rays);
  if (!vertices.seeds().empty()) vertices.seeds().sweep(context, tape);
  return append_finite(tape, contributions);
}

}  // namespace limn
