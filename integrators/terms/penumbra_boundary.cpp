// The boundary term of thin penumbras, see penumbra.h. With p(omega) what a viewer q sees in the
// direction omega and T the throughput to there, `direct` is
//   integral of T(omega) times the integral over edges of C(p(omega), t) dt domega,
// with C its integrand. Here a point e(t) of an edge is drawn first, then a line through it from a
// direction where region k lies; behind e it meets p, in whose direction omega its density is
//   pdf(line) (|n . line| / |p - e|^2) / (|n . omega| / |p - q|^2) :
// the estimate C over all densities stays bounded where emitter and distance vanish. Where q is a
// vertex close to p it is found by a line from p, whose density goes with 1 / |p - q|^2, too.
#include <fmt/format.h>

#include "integrators/film/film_point.h"
#include "integrators/terms/penumbra_lines.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

namespace {

// What a line costs beside its rays, which go anywhere in the scene, in the unit of Term::work:
// timed as 1.9 (the sun), 2.1 (soft shadow, plant), 3.0 (CAD part), 3.9 (four emitters), 5.0
// (concave).
constexpr double kLineCost = 3;

class PenumbraTerm final : public Term {
 public:
  explicit PenumbraTerm(TermInput& input)
      : context_(input.context),
        edges_(input.edges()),
        regions_(*input.regions()),
        emitter_edges_(*input.emitter_edges()),
        lines_(context_, edges_, regions_, emitter_edges_) {}

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return emitter_edges_.size() > 0 && (max_depth < 0 || max_depth > 1);
  }
  void sample_film(double u, const Rng& key, FilmSink& sink) const override;
  bool uses_vertices() const override { return emitter_edges_.size() > 0; }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      add_sample(vertex, vertex.key.copy(Purpose::kShadowCopy, i), sink);
    }
  }
  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) + kLineCost * static_cast<double>(cost.samples);
  }
  void describe(GradientStats& stats) const override {
    stats.edges.emplace_back("before emitters", emitter_edges_.size());
  }

 private:
  // Of the film: a line that is scattered to the vertex before.
  void add_scattered(double u, const Rng& key, FilmSink& sink) const;
  // viewer: the vertex before.
  void add_sample(const PathVertex& viewer, const Rng& key, BoundarySink& sink) const;
  // The line seen from q, for a path of this throughput.
  void add(const DrawnLine& drawn, const Vec3d& q, const SeenAlong& along,
           const Rgb<double>& throughput, int bounces, const Rng& key, BoundarySink& sink) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  const EmitterEdges& emitter_edges_;
  PenumbraLines lines_;
};

void PenumbraTerm::sample_film(double u, const Rng& key, FilmSink& sink) const {
  const double scattered = lines_.ways().scattered;
  if (u < scattered) return add_scattered(u / scattered, key, sink);
  u = (u - scattered) / (1 - scattered);
  Rng rng = key.at(Purpose::kShadow, 0);
  RayCount rays;
  auto drawn = lines_.draw(u, rng, rays);
  sink.cost().add(rays);
  if (!drawn) return;
  const LensPoint lens = sample_lens(context_.scene.camera, key);
  const auto seen = film_point(context_.scene, drawn->face, drawn->line.p, lens);
  if (!seen || !sink.at(seen->at)) return;
  const Vec3d from = value(seen->ray.origin);
  if (!lines_.complete(*drawn, {from, 0}, 0, rng)) return;
  RayCount shadow;
  const bool hidden = is_hidden(context_, *seen, drawn->face, shadow);
  sink.cost().add(shadow);
  if (hidden) return;
  drawn->edge.probability *=
      (1 - scattered) / film_per_solid_angle(context_.scene.camera, seen->omega, seen->distance);
  add(*drawn, from, {seen->omega, seen->distance}, grey(1.0), 0, key, sink);
}

void PenumbraTerm::add_scattered(double u, const Rng& key, FilmSink& sink) const {
  const Scene& scene = context_.scene;
  Rng rng = key.at(Purpose::kShadow, 0);
  RayCount rays;
  auto drawn = lines_.draw(u, rng, rays);
  const double u_0 = rng.uniform(), u_1 = rng.uniform();
  const auto viewer =
      drawn ? lines_.scatter(*drawn, u_0, u_1, sample_lens(scene.camera, key), rays) : std::nullopt;
  sink.cost().add(rays);
  if (!viewer || !sink.at(viewer->seen.at)) return;
  const auto& [face, q, seen] = *viewer;
  const Vec3d from = value(seen.ray.origin);
  const auto surface = surface_on_ray<double>(scene, face, from, seen.omega);
  const Scattering<double> scattering(surface, -seen.omega, scene.shading);
  if (scattering.black()) return;
  const PathVertex vertex{surface, scattering, grey(1.0), {}, {}, 0, {from}, key};
  const Vec3d to = drawn->line.p - q;
  const SeenAlong along{to / length(to), length(to), &*viewer};
  const PathStep step = lines_.step_from(vertex, along.omega);
  const Rgb<double> f = step.pdf > 0 ? scattering.eval_value(along.omega) : Rgb<double>{};
  if (is_black(f) || !lines_.complete(*drawn, step, 1, rng, true)) return;
  RayCount shadow;
  const bool hidden = is_hidden(context_, seen, face, shadow);
  sink.cost().add(shadow);
  if (hidden) return;
  drawn->edge.probability *= lines_.ways().scattered * scattered_density(scene, drawn->line, step);
  add(*drawn, q, along, f, 1, key, sink);
}

void PenumbraTerm::add_sample(const PathVertex& viewer, const Rng& key, BoundarySink& sink) const {
  const auto seen = lines_.seen_from(viewer, key, sink.cost());
  if (!seen) return;
  const auto& [drawn, along, f] = *seen;
  if (sink.log()) {
    sink.log()->push_back(fmt::format("  penumbra on face {} of shape {}:", drawn.face.face.index(),
                                      drawn.face.shape.index()));
  }
  add(drawn, viewer.surface.p, along, viewer.throughput * f, viewer.bounces + 1, key, sink);
}

void PenumbraTerm::add(const DrawnLine& drawn, const Vec3d& q, const SeenAlong& along,
                       const Rgb<double>& throughput, int bounces, const Rng& key,
                       BoundarySink& sink) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<double>(scene, drawn.face, q, along.omega);
  const Scattering<double> scattering(surface, -along.omega, scene.shading);
  if (scattering.black()) return;
  PathVertex vertex{surface, scattering, throughput, {}, {}, bounces, {}, key};
  vertex.below = scattering.passes(drawn.line.e - drawn.line.p);
  EdgeDraw draw{
      edges_.object(drawn.edge.edge.object), drawn.edge, {&regions_, drawn.line.region}, key};
  draw.held = regions_.shape(drawn.line.region).valid();
  draw.along = &along;
  add_edge_point(context_, vertex, draw, sink);
}

}  // namespace

std::unique_ptr<Term> make_penumbra_term(TermInput& input) {
  return std::make_unique<PenumbraTerm>(input);
}

}  // namespace limn
