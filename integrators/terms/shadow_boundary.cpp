// The boundary term of delta lights: the edges of their sharp shadows, listed as seen from the
// light and seen in turn by the camera and by the vertices of paths.
//
// A point, or parallel light, lights all or nothing of a surface: radiance jumps where a plane
// through the light and an edge of the mesh meets what lies behind the edge. With y(t) =
// (1 - t) y0 + t y1 a point of the edge, w(t) the direction in which light passes through it (y - l
// for a light at l, the direction d of parallel light) and N = w(0) x (y1 - y0), the function
//   G(x) = N . (x - y0)
// changes sign on that plane. From a viewer q in the fixed direction omega a surface is met at
// x(omega), and the derivative of the integral of f L H(G) over directions holds
//   integral of  f dL dG/dtheta delta(G) domega,
// where dL is the light's share of the radiance that leaves x towards q, positive if the side G > 0
// is lit, and dG/dtheta carries the motion of light, edge, viewer and of the surface at x. With n
// the normal at x, r = |x - q| and cos_x = n . omega,
//   delta(G) domega = m(t) |cos_x| / r^2 dt,   m(t) = |x - l| / (|w| |n . w|),   1 / |n . d| at
// infinity, which follows from dx/dt = m n x (dw/dt x w) (and |n x N| is G's slope on the surface).
// Where rays start above the surface, L H(G) has G of the point that x is lifted to, and m is
// |dx/dt| over G's slope by x.
#include <fmt/format.h>

#include "integrators/film/film_point.h"
#include "integrators/terms/shadow_edges.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// Where a viewer's ray meets a shadow's edge.
struct Sight {
  Vec3d omega;  // unit, from the viewer
  double distance;
};

class ShadowTerm final : public Term {
 public:
  explicit ShadowTerm(TermInput& input)
      : context_(input.context), input_(input.edges()), edges_(context_, input_, input.lanes) {}

  bool uses_vertices() const override { return !edges_.empty(); }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
      add_sample(vertex, key.at(Purpose::kShadow, vertex.bounces), sink);
    }
  }

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return !edges_.empty() && (max_depth < 0 || max_depth > 1);
  }
  void sample_film(double u, const Rng& key, FilmSink& sink) const override;

  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges of sharp shadows", edges_.list_seconds());
    stats.edges.emplace_back("of sharp shadows", edges_.size());
  }

 private:
  // dG/dtheta times delta(G) domega / dt, times `scale`.
  BoundaryForm sweep(const ShadowEdge& edge, const ShadowPoint& point, const Sight& sight,
                     double scale) const;
  void add_sample(const PathVertex& vertex, Rng rng, BoundarySink& sink) const;

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  ShadowEdges edges_;
};

// With e = y1 - y0 and r = x - y0, dG = dw . (e x r) + de . (r x w) + N . (dx - dy0).
BoundaryForm ShadowTerm::sweep(const ShadowEdge& edge, const ShadowPoint& point, const Sight& sight,
                               double scale) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3d y0 = mesh.position(ends[0]), e = mesh.position(ends[1]) - y0, r = point.lit - y0;
  const LightOrigin origin = edge.light->origin();
  const Vec3d w = origin.through(y0);
  const Vec3d normal = cross(w, e), of_w = cross(e, r), of_e = cross(r, w);
  BoundaryForm form;
  form.x = point.x;
  form.distance = sight.distance;
  form.add_edge(mesh, edge.id, 0, origin.infinite ? -of_e - normal : of_w - of_e - normal);
  form.add_edge(mesh, edge.id, 1, of_e);
  form.add_light(*edge.light, origin.infinite ? of_w : -of_w);
  const double cosine = form.add_seen_point(context_.scene, point.face, sight.omega, normal);
  form.scale = point.m * cosine / (sight.distance * sight.distance) * scale;
  return form;
}

void ShadowTerm::add_sample(const PathVertex& vertex, Rng rng, BoundarySink& sink) const {
  TermCost& cost = sink.cost();
  ++cost.samples;
  double probability;
  const ShadowEdge& edge = edges_.choose(rng.uniform(), probability);
  RayCount rays;
  const auto point = edges_.cast(edge, rng.uniform(), rays);
  cost.add(rays);
  if (!point) {
    ++cost.occluded;
    return;
  }
  const Vec3d q = vertex.surface.p;
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != vertex.surface.start();
  const Rgb<double> f = apart ? vertex.scattering.eval_value(omega) : Rgb<double>{};
  const Rgb<double> amount =
      is_black(f) ? f : vertex.throughput * f * edges_.jump(edge, *point, q, omega);
  BoundaryForm form;
  if (!is_black(amount)) form = sweep(edge, *point, {omega, distance}, 1 / probability);
  if (is_black(amount) || !sink.takes(form, rng)) {
    ++cost.zero_weight;
    return;
  }
  const Vec3d way = point->target(q) - q;
  if (is_hidden_from(context_, vertex, point->face, normalize(way), length(way), cost)) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  if (sink.log()) {
    sink.log()->push_back(
        fmt::format("  shadow of edge {} of shape {} on face {} of shape {}: probability {:.4g}",
                    edge.id.edge.index(), edge.id.object.index(), point->face.face.index(),
                    point->face.shape.index(), probability));
  }
  sink.add(amount);
}

void ShadowTerm::sample_film(double u, const Rng& key, FilmSink& sink) const {
  double probability;
  const ShadowEdge& edge = edges_.choose(u, probability);
  RayCount rays;
  const auto point = edges_.cast(edge, key.at(Purpose::kShadow, 0).uniform(), rays);
  sink.cost().add(rays);
  if (!point) return;
  const auto seen = film_point(context_.scene, point->face, point->x);
  if (!seen || !sink.at(seen->x, seen->y)) return;
  const Vec3d q = value(seen->ray.origin);
  const Rgb<double> amount = edges_.jump(edge, *point, q, seen->omega);
  const double scale = film_per_solid_angle(context_.scene.camera, seen->omega) / probability;
  if (is_black(amount)) return;
  const BoundaryForm form = sweep(edge, *point, {seen->omega, seen->distance}, scale);
  if (!sink.takes(form, key)) return;
  RayCount shadow;
  const bool hidden = is_hidden(context_, aimed_at(*seen, point->target(q)), point->face, shadow);
  sink.cost().add(shadow);
  if (!hidden) sink.add(amount);
}

}  // namespace

std::unique_ptr<Term> make_shadow_term(TermInput& input) {
  return std::make_unique<ShadowTerm>(input);
}

}  // namespace limn
