// One path on the tape. At its vertices edges are drawn as in forward mode, with an importance that
// knows no motion.
#include "integrators/backward/path_adjoint.h"

#include <algorithm>
#include <cmath>

#include "integrators/backward/adjoint_sinks.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"

namespace limn {
namespace {

// The terms at vertices, as the visitor of a path.
class VertexAdjoints {
 public:
  VertexAdjoints(const AdjointContext& context, const Rgb<double>& adjoint, Tape& tape,
                 AdjointCosts& costs)
      : context_(context),
        adjoint_(adjoint * (1.0 / context.edge_samples)),
        tape_(tape),
        costs_(costs) {}

  // The vertices of all that moves have unit tangents along the axes, and this one their opposites,
  // if it moves, so that an edge never seems to rest beside it.
  void operator()(const SurfacePoint<Var>& surface, const Scattering<Var>& scattering,
                  const Rgb<Var>& throughput, const DirectionMotion*, const PathStep& step,
                  int bounces, const Rng& key) {
    PathVertex vertex =
        plain_vertex(surface, scattering, context_.scene().shading, bounces, step, key);
    vertex.throughput = value(throughput);
    if (!is_constant(surface.p)) vertex.velocity = {{-1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}};
    VertexAdjoint sink(context_.motion, adjoint_, surface.p, tape_, seeds_);
    for (size_t slot = 0; slot < context_.terms.size(); ++slot) {
      const Term* term = context_.terms[slot].get();
      if (!term || !term->uses_vertices()) continue;
      const Stopwatch watch;
      sink.book_on(costs_[slot]);
      term->add_at_vertex(vertex, context_.edge_samples, sink);
      costs_[slot].seconds += watch.seconds();
    }
  }

  Seeds& seeds() { return seeds_; }

 private:
  const AdjointContext& context_;
  Rgb<double> adjoint_;
  Tape& tape_;
  AdjointCosts& costs_;
  Seeds seeds_;
};

// The ray through a film position, moving with the camera where that has slots.
CameraRay<Var> moving_ray(const AdjointContext& context, const FilmPosition& film,
                          const CameraRay<double>& ray) {
  if (context.motion.slots().camera != 0) {
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
  TermCost& cost = costs[context.pixel_slot];
  VertexAdjoints vertices(context, adjoint, tape, costs);
  // As in forward mode: in closed form a path takes two places of its pixel.
  const int places = context.path.closed ? 2 : 1;
  for (int i = 0; i < places; ++i) {
    FilmPosition film = sample_pixel_filter(context.scene().film, context.filter, x, y, key);
    if (i > 0) film = mirrored_in_pixel(context.scene().film, x, y, film);
    const auto still = context.scene().camera.ray<double>(film.x, film.y);
    const auto ray = moving_ray(context, film, still);
    RayCount rays;
    ++cost.samples;
    PathTracer<Var, VertexAdjoints> tracer(context.path, rays);
    Walk<Var, VertexAdjoints> walk(key, 0, &vertices);
    const StartRay<Var> start{camera_ray(context.scene(), still), ray.origin, ray.direction};
    tracer.follow_rays({&start, 1}, {&walk, 1});
    const Rgb<Var>& radiance = walk.sums.radiance;
    if (walk.failed || !is_finite(value(radiance))) return false;
    if (context.terms[context.pixel_slot]) {
      for (int c = 0; c < 3; ++c) vertices.seeds().add(radiance[c].node, adjoint[c] / places);
    }
    cost.add(rays);
  }
  if (!vertices.seeds().empty()) vertices.seeds().sweep(tape);
  return append_finite(tape, contributions);
}

bool add_film_adjoint(const AdjointContext& context, const FilmAdjoint& film, const FilmDraw& draw,
                      Tape& tape, TermCost& cost, std::vector<Contribution>& contributions) {
  tape.clear();
  ++cost.samples;
  FilmPointAdjoint sink(context.motion, film, draw.share, tape);
  context.terms[draw.slot]->sample_film(draw.u, draw.key, sink);
  cost.rays += sink.cost().rays;
  cost.shadow_rays += sink.cost().shadow_rays;
  if (!sink.added()) {
    ++(sink.asked() ? cost.occluded : cost.zero_weight);
    return true;
  }
  ++cost.counted;
  if (!sink.seeds().empty()) sink.seeds().sweep(tape);
  return append_finite(tape, contributions);
}

}  // namespace limn
