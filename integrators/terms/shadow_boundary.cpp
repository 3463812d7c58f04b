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
#include <fmt/format.h>

#include "integrators/film/film_point.h"
#include "integrators/terms/shadow_edges.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// A ray from a viewer that meets the shadow's edge.
struct Viewer {
  Vec3<Dual> origin;
  Vec3<Dual> direction;  // unit; held fixed, or turning with the camera or the directions of a path
  double distance;       // to the shadow's edge
};

class ShadowTerm final : public Term {
 public:
  explicit ShadowTerm(TermInput& input)
      : context_(input.context), input_(input.edges()), edges_(context_, input_, input.lanes) {}

  bool uses_vertices() const override { return !edges_.empty(); }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    for (int i = 0; i < samples; ++i) {
      const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
      add_sample(vertex, key.at(Purpose::kShadow, vertex.bounces), cost, sum);
    }
  }

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return !edges_.empty() && (max_depth < 0 || max_depth > 1);
  }
  bool sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const override;

  void move_film(const FilmMotionAt& motion) override { moves_film_ = motion != nullptr; }
  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges of sharp shadows", edges_.list_seconds());
    stats.edges.emplace_back("of sharp shadows", edges_.size());
  }

 private:
  // dG/dtheta times delta(G) domega / dt.
  Lanes sweep(const ShadowEdge& edge, const ShadowPoint& point, const Viewer& viewer) const;
  void add_sample(const PathVertex& vertex, Rng rng, TermCost& cost, Rgb<Lanes>& sum) const;

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  ShadowEdges edges_;
  bool moves_film_ = false;
};

Lanes ShadowTerm::sweep(const ShadowEdge& edge, const ShadowPoint& point,
                        const Viewer& viewer) const {
  const EdgeMesh& mesh = input_.object(edge.id.object);
  const auto& ends = mesh.edge(edge.id.edge).vertices;
  const Vec3<Dual> y0 = moving_vertex(mesh, ends[0]);
  const Vec3<Dual> normal =
      cross(edge.light->origin().through(y0), moving_vertex(mesh, ends[1]) - y0);
  const auto x = surface_on_ray<Dual>(context_.scene, point.face, viewer.origin, viewer.direction);
  const double cosine = std::fabs(dot(x.n_g, value(viewer.direction)));
  return dot(normal, x.p - y0).d * (point.m * cosine / (viewer.distance * viewer.distance));
}

void ShadowTerm::add_sample(const PathVertex& vertex, Rng rng, TermCost& cost,
                            Rgb<Lanes>& sum) const {
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
  const Vec3d q = value(vertex.surface.p);
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != vertex.surface.face;
  const Rgb<double> f = apart ? vertex.scattering.eval_value(omega) : Rgb<double>{};
  if (is_black(f)) {
    ++cost.zero_weight;
    return;
  }
  const Lanes swept =
      sweep(edge, *point,
            {vertex.surface.p, moving_direction(vertex, omega, rng.at(Purpose::kShadow, 1), cost),
             distance});
  const Rgb<double> amount = vertex.throughput * f * edges_.jump(edge, *point, q, omega);
  if (is_zero(swept) || is_black(amount)) {
    ++cost.zero_weight;
    return;
  }
  const Vec3d way = point->target(q) - q;
  if (is_hidden_from(context_, vertex, point->face, normalize(way), length(way), cost)) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const Lanes weight = swept * (1 / probability);
  const Rgb<Lanes> added{weight * amount.r, weight * amount.g, weight * amount.b};
  if (TurnedVertex* turned = vertex.turned) {
    // What does not turn is in both.
    const Vec3<Lanes>& v = turned->velocity;
    const Viewer turns{
        {{q.x, v.x}, {q.y, v.y}, {q.z, v.z}}, turning(omega, turned->turn), distance};
    const Viewer rests{{q.x, q.y, q.z}, turning(omega, {}), distance};
    const Lanes of_turns = sweep(edge, *point, turns) - sweep(edge, *point, rests);
    for (int c = 0; c < 3; ++c) turned->sum[c] += of_turns * (amount[c] / probability);
  }
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "  shadow of edge {} of shape {} on face {} of shape {}: probability {:.4g}, adds "
        "({:.6g}, {:.6g}, {:.6g}) to the first parameter",
        edge.id.edge.index(), edge.id.object.index(), point->face.face.index(),
        point->face.shape.index(), probability, added.r[0], added.g[0], added.b[0]));
  }
  sum = sum + added;
}

bool ShadowTerm::sample_film(double u, const Rng& key, RayCount& rays, FilmSample& sample) const {
  double probability;
  const ShadowEdge& edge = edges_.choose(u, probability);
  const auto point = edges_.cast(edge, key.at(Purpose::kShadow, 0).uniform(), rays);
  if (!point) return false;
  const auto seen = film_point(context_.scene, point->face, point->x);
  if (!seen) return false;
  const Lanes swept = sweep(edge, *point, {seen->ray.origin, seen->ray.direction, seen->distance});
  const Rgb<double> amount = edges_.jump(edge, *point, value(seen->ray.origin), seen->omega);
  if ((is_zero(swept) && !moves_film_) || is_black(amount)) return false;
  if (is_hidden(context_, aimed_at(*seen, point->target(value(seen->ray.origin))), point->face,
                rays))
    return false;
  sample.x = seen->x;
  sample.y = seen->y;
  const double share = film_per_solid_angle(context_.scene.camera, seen->omega) / probability;
  const Lanes weight = swept * share;
  sample.value = {weight * amount.r, weight * amount.g, weight * amount.b};
  if (moves_film_) {
    const auto ray = shifted_ray(context_.scene.camera, *seen);
    const auto at_rest = [](const Vec3<Dual>& v) { return Vec3<Dual>{v.x.v, v.y.v, v.z.v}; };
    // What moves by itself is in both.
    const Lanes by_film =
        sweep(edge, *point, {at_rest(ray.origin), at_rest(ray.direction), seen->distance}) -
        sweep(edge, *point, {ray.origin, ray.direction, seen->distance});
    sample.along_x = amount * (by_film[0] * share);
    sample.along_y = amount * (by_film[1] * share);
  }
  return true;
}

}  // namespace

std::unique_ptr<Term> make_shadow_term(TermInput& input) {
  return std::make_unique<ShadowTerm>(input);
}

}  // namespace limn
