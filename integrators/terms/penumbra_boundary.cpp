// The boundary term of thin penumbras, see penumbra.h. With p(omega) what a viewer q sees in the
// direction omega and T the throughput to there, `direct` is
//   integral of T(omega) times the integral over edges of C(p(omega), t) dt domega,
// with C its integrand. Here a point e(t) of an edge is drawn first, then a line through it from a
// direction where region k lies; behind e it meets p, in whose direction omega its density is
//   pdf(line) (|n . line| / |p - e|^2) / (|n . omega| / |p - q|^2) :
// the estimate C over all densities stays bounded where lamp and distance vanish. What the turn of
// directions at p changes is left to `direct`.
#include <fmt/format.h>

#include "integrators/film/film_point.h"
#include "integrators/terms/penumbra_lines.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

namespace {

// What a line costs beside its rays, which go anywhere in the scene, in the unit of Term::work:
// timed as 1.9 (the sun), 2.1 (soft shadow, plant), 3.0 (CAD part), 3.9 (four lamps), 5.0
// (concave).
constexpr double kLineCost = 3;

class PenumbraTerm final : public Term {
 public:
  explicit PenumbraTerm(TermInput& input)
      : context_(input.context),
        edges_(input.edges()),
        regions_(*input.regions()),
        lamp_edges_(*input.lamp_edges()),
        lines_(context_, edges_, regions_, lamp_edges_) {}

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return lamp_edges_.size() > 0 && (max_depth < 0 || max_depth > 1);
  }
  bool sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const override;
  bool uses_vertices() const override { return lamp_edges_.size() > 0; }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
      add_sample(vertex, key, cost, sum);
    }
  }
  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) + kLineCost * static_cast<double>(cost.samples);
  }
  void move_film(const FilmMotionAt& motion) override { moves_film_ = motion != nullptr; }
  void describe(GradientStats& stats) const override {
    stats.edges.emplace_back("before lamps", lamp_edges_.size());
  }

 private:
  // What a viewer sees that is no camera: the vertex before.
  void add_sample(const PathVertex& viewer, const Rng& key, TermCost& cost, Rgb<Lanes>& sum) const;
  // What the drawn line adds for a path that comes along the ray with the throughput.
  void add(const DrawnLine& drawn, const Vec3<Dual>& origin, const Vec3<Dual>& direction,
           const Rgb<double>& throughput, int bounces, const Rng& key, SampleLog* log,
           TurnedVertex* turned, TermCost& cost, Rgb<Lanes>& sum) const;
  // How the point that the line meets slides if the viewer's ray moves so, but for what it does if
  // the ray rests.
  Vec3<Lanes> sliding(const DrawnLine& drawn, const Vec3<Dual>& q, const Vec3<Dual>& omega) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  const LampEdges& lamp_edges_;
  PenumbraLines lines_;
  bool moves_film_ = false;
};

bool PenumbraTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  Rng rng = key.at(Purpose::kShadow, 0);
  auto drawn = lines_.draw(u, rng, rays);
  if (!drawn) return false;
  const auto seen = film_point(context_.scene, drawn->face, drawn->line.p);
  if (!seen || !lines_.complete(*drawn, {}, 0, rng)) return false;
  if (is_hidden(context_, *seen, drawn->face, rays)) return false;
  drawn->edge.probability /= film_per_solid_angle(context_.scene.camera, seen->omega);
  TermCost cost;
  Rgb<Lanes> sum;
  TurnedVertex shifted;
  if (moves_film_) {
    const auto ray = shifted_ray(context_.scene.camera, *seen);
    shifted.velocity = sliding(*drawn, ray.origin, ray.direction);
  }
  add(*drawn, seen->ray.origin, seen->ray.direction, grey(1.0), 0, key, nullptr,
      moves_film_ ? &shifted : nullptr, cost, sum);
  rays.closest += cost.rays - cost.shadow_rays;
  rays.shadow += cost.shadow_rays;
  sample = {seen->x, seen->y, sum};
  for (int c = 0; c < 3; ++c) {
    sample.along_x[c] = -shifted.sum[c][0];
    sample.along_y[c] = -shifted.sum[c][1];
  }
  return cost.counted > 0;
}

void PenumbraTerm::add_sample(const PathVertex& viewer, const Rng& key, TermCost& cost,
                              Rgb<Lanes>& sum) const {
  const auto seen = lines_.seen_from(viewer, key, cost);
  if (!seen) return;
  const auto& [drawn, omega, f] = *seen;
  if (viewer.log) {
    viewer.log->push_back(fmt::format("  penumbra on face {} of shape {}:", drawn.face.face.index(),
                                      drawn.face.shape.index()));
  }
  TurnedVertex turned;
  if (viewer.turned) {
    const Vec3<Lanes>& v = viewer.turned->velocity;
    const Vec3d q = value(viewer.surface.p);
    turned.velocity =
        sliding(drawn, {{q.x, v.x}, {q.y, v.y}, {q.z, v.z}}, turning(omega, viewer.turned->turn));
  }
  add(drawn, viewer.surface.p, turning(omega, viewer.turn), viewer.throughput * f,
      viewer.bounces + 1, key, viewer.log, viewer.turned ? &turned : nullptr, cost, sum);
  if (viewer.turned) viewer.turned->sum = viewer.turned->sum + turned.sum;
}

Vec3<Lanes> PenumbraTerm::sliding(const DrawnLine& drawn, const Vec3<Dual>& q,
                                  const Vec3<Dual>& omega) const {
  const auto at_rest = [](const Vec3<Dual>& v) { return Vec3<Dual>{v.x.v, v.y.v, v.z.v}; };
  const auto moves = surface_on_ray<Dual>(context_.scene, drawn.face, q, omega);
  const auto rests = surface_on_ray<Dual>(context_.scene, drawn.face, at_rest(q), at_rest(omega));
  return {moves.p.x.d - rests.p.x.d, moves.p.y.d - rests.p.y.d, moves.p.z.d - rests.p.z.d};
}

void PenumbraTerm::add(const DrawnLine& drawn, const Vec3<Dual>& origin,
                       const Vec3<Dual>& direction, const Rgb<double>& throughput, int bounces,
                       const Rng& key, SampleLog* log, TurnedVertex* turned, TermCost& cost,
                       Rgb<Lanes>& sum) const {
  const Scene& scene = context_.scene;
  const auto surface = surface_on_ray<Dual>(scene, drawn.face, origin, direction);
  const Scattering<Dual> scattering(surface, -direction, scene.shading);
  if (scattering.black()) return;
  const PathVertex vertex{surface, scattering, throughput, {}, bounces, {}, key, log, turned};
  add_edge_point(context_, edges_.object(drawn.edge.edge.object), vertex, query_at(vertex),
                 drawn.edge, {&regions_, drawn.line.region}, key, cost, sum);
}

}  // namespace

std::unique_ptr<Term> make_penumbra_term(TermInput& input) {
  return std::make_unique<PenumbraTerm>(input);
}

}  // namespace limn
