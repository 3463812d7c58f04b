// The boundary term of delta lights: the edges of their sharp shadows, listed as seen from the
// light and seen in turn by the camera and by the vertices of paths.
//
// A point, or parallel light, lights all or nothing of a surface: radiance is discontinuous where a
// plane through the light and an edge of the mesh meets what lies behind the edge. With y(t) =
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
// |dx/dt| over G's slope by x. The line through y meets lifted points several times before a face
// blocks it (lifted_faces.h); each is a shadow's edge.
//
// Near a vertex q samples go with 1 / r^2, and points drawn as the light sees the edges would make
// them rare and huge. So most points are drawn as the vertex sees the shadows (shadow_pieces.h),
// the others as the light sees the edges, and all are weighed by the density of both together.
// Vertices that the camera sees are found from the shadow, too (shadow_lines.h).
#include <fmt/format.h>

#include <optional>

#include "integrators/film/film_point.h"
#include "integrators/paths/straight_way.h"
#include "integrators/terms/shadow_edges.h"
#include "integrators/terms/shadow_lines.h"
#include "integrators/terms/shadow_pieces.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// Where a viewer's ray meets a shadow's edge.
struct Sight {
  Vec3d omega;  // unit, from the viewer
  double distance;
};

// The share of draws by pieces. Not tuned.
constexpr double kPieceShare = 0.75;

class ShadowTerm final : public Term {
 public:
  explicit ShadowTerm(TermInput& input)
      : context_(input.context),
        frames_(context_.scene, input.edges()),
        input_(frames_.edges()),
        edges_(context_, frames_, input.lanes),
        lines_(context_, input_),
        warps_(input.warps) {
    if (edges_.empty() || !is_seen_again()) return;
    const Stopwatch watch;
    pieces_.emplace(context_, input_, edges_.edges(), input.free != nullptr, input.threads);
    if (pieces_->empty()) pieces_.reset();
    piece_seconds_ = watch.seconds();
  }

  bool uses_vertices() const override { return !edges_.empty(); }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override {
    const int max_depth = context_.scene.max_depth;
    if (max_depth >= 0 && vertex.bounces + 2 >= max_depth) return;
    if (samples > 0) add_samples(vertex, samples, sink);
  }
  double work(const TermCost& cost) const override {
    const double draw = pieces_ ? kPieceShare * pieces_->sampler().draw_cost() : 0;
    return static_cast<double>(cost.rays) + draw * static_cast<double>(cost.samples) +
           first_work(cost);
  }
  double first_work(const TermCost& cost) const override {
    const double query = pieces_ ? pieces_->sampler().query_cost() : 0;
    return query * static_cast<double>(cost.samples);
  }

  bool uses_film() const override {
    const int max_depth = context_.scene.max_depth;
    return !edges_.empty() && (max_depth < 0 || max_depth > 1);
  }
  void sample_film(double u, const Rng& key, FilmSink& sink) const override;

  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edges of sharp shadows", edges_.list_seconds());
    stats.edges.emplace_back("of sharp shadows", edges_.size());
    if (!pieces_) return;
    stats.setup.emplace_back("sharp shadows on faces", piece_seconds_);
    stats.edges.emplace_back("of sharp shadows on faces", pieces_->pieces().size());
  }

 private:
  // dG/dtheta times delta(G) domega / dt, times `scale`.
  BoundaryForm sweep(const ShadowEdge& edge, const ShadowPoint& point, const Sight& sight,
                     double scale) const;
  // Whether vertices of paths see what is lit.
  bool is_seen_again() const {
    return context_.scene.max_depth < 0 || context_.scene.max_depth > 2;
  }
  // Lines find no vertex that sees the shadow straight through a surface, and do not know how
  // directions are warped.
  bool draws_lines() const { return pieces_ && !context_.straight_ways && !warps_; }
  void add_samples(const PathVertex& vertex, int samples, BoundarySink& sink) const;
  // A vertex of a path, and what of it lines may find.
  struct Viewer {
    const PathVertex& vertex;
    const EdgeQuery query;
    std::optional<SeenVertex> by_lines;
  };
  void add_sample(const Viewer& viewer, const ShadowDraw& draw, const Rng& key,
                  BoundarySink& sink) const;
  // Of the film: shadows that the camera sees, and vertices that lines find.
  void add_seen(double u, double share, const Rng& key, FilmSink& sink) const;
  void add_line(double u, const Rng& key, FilmSink& sink) const;
  // Of a draw with this density by the pieces.
  double density(const ShadowDraw& draw, double by_pieces) const {
    const double by_edges = edges_.probability(draw.edge);
    return pieces_ ? kPieceShare * by_pieces + (1 - kPieceShare) * by_edges : by_edges;
  }

  const PathContext& context_;
  LightFrames frames_;
  const EdgeSamplerInput& input_;
  ShadowEdges edges_;
  ShadowLines lines_;
  bool warps_;
  std::optional<ShadowPieces> pieces_;
  double piece_seconds_ = 0;
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
  form.scale = point.m * cosine / (sight.distance * sight.distance * point.probability) * scale;
  return form;
}

void ShadowTerm::add_samples(const PathVertex& vertex, int samples, BoundarySink& sink) const {
  static thread_local std::vector<Rng> by_edges, by_pieces;
  static thread_local std::vector<std::optional<ShadowDraw>> draws;
  by_edges.clear();
  by_pieces.clear();
  double share = 0;
  for (int i = 0; i < samples; ++i) {
    const Rng key = vertex.key.copy(Purpose::kShadowCopy, i);
    Rng rng = key.at(Purpose::kShadow, vertex.bounces);
    if (i == 0) share = rng.uniform();
    share += pieces_ ? kPieceShare : 0;
    (share >= 1 ? by_pieces : by_edges).push_back(rng);
    if (share >= 1) share -= 1;
  }
  sink.cost().samples += static_cast<uint64_t>(samples);
  Viewer viewer{vertex, query_at(vertex), {}};
  if (draws_lines() && vertex.bounces == 0) {
    viewer.by_lines = seen_vertex(context_.scene, vertex.surface.face, vertex.surface.p,
                                  sample_lens(context_.scene.camera, vertex.key));
  }
  for (Rng& rng : by_edges) {
    const uint32_t edge = edges_.choose(rng.uniform());
    const double t = rng.uniform();
    add_sample(viewer, {edge, t, -1}, rng, sink);
  }
  if (by_pieces.empty()) return;
  pieces_->draw(viewer.query, by_pieces, draws);
  for (size_t i = 0; i < by_pieces.size(); ++i) {
    if (draws[i]) {
      add_sample(viewer, *draws[i], by_pieces[i], sink);
    } else {
      ++sink.cost().no_edge;
    }
  }
}

// draw.density: by pieces; negative if it is not known.
void ShadowTerm::add_sample(const Viewer& viewer, const ShadowDraw& draw, const Rng& key,
                            BoundarySink& sink) const {
  const PathVertex& vertex = viewer.vertex;
  TermCost& cost = sink.cost();
  const ShadowEdge& edge = edges_.edge(draw.edge);
  RayCount rays;
  const auto point = edges_.cast(edge, draw.t, key, rays);
  cost.add(rays);
  if (!point) {
    ++cost.occluded;
    return;
  }
  const Vec3d q = vertex.surface.p;
  const double distance = length(point->x - q);
  const Vec3d omega = (point->x - q) / distance;
  const bool apart = distance > 0 && point->face != vertex.surface.start();
  const Rgb<double> f = apart ? vertex.scattered(omega) : Rgb<double>{};
  const Rgb<double> amount =
      is_black(f) ? f : vertex.throughput * f * edges_.difference(edge, *point, q, omega);
  BoundaryForm form;
  double by_pieces = draw.density;
  if (!is_black(amount)) {
    if (pieces_ && by_pieces < 0) by_pieces = pieces_->density(viewer.query, draw.edge, draw.t);
    double share = 1;
    if (viewer.by_lines) {
      share -= lines_.share(edge, edges_.probability(draw.edge), *point, *viewer.by_lines,
                            lines_.density(edge, *point, *viewer.by_lines), vertex.scattering);
    }
    form = sweep(edge, *point, {omega, distance}, share / density(draw, by_pieces));
  }
  if (is_black(amount) || !sink.takes(form, key)) {
    ++cost.zero_weight;
    return;
  }
  const Vec3d way = point->target(q) - q;
  RayCount shadow;
  const auto share = share_along(context_, ray_to(vertex, point->face, normalize(way), length(way)),
                                 vertex.bounces + 1, shadow);
  cost.add(shadow);
  if (!share) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  if (sink.log()) {
    sink.log()->push_back(
        fmt::format("  shadow of edge {} of shape {} on face {} of shape {}: density {:.4g}",
                    edge.id.edge.index(), edge.id.object.index(), point->face.face.index(),
                    point->face.shape.index(), density(draw, by_pieces)));
  }
  sink.add(amount * *share);
}

void ShadowTerm::sample_film(double u, const Rng& key, FilmSink& sink) const {
  const double share = draws_lines() ? ShadowLines::kShare : 0;
  if (u < share) {
    add_line(u / share, key, sink);
  } else {
    add_seen((u - share) / (1 - share), 1 - share, key, sink);
  }
}

void ShadowTerm::add_seen(double u, double share, const Rng& key, FilmSink& sink) const {
  const uint32_t chosen = edges_.choose(u);
  const ShadowEdge& edge = edges_.edge(chosen);
  RayCount rays;
  const auto point = edges_.cast(edge, key.at(Purpose::kShadow, 0).uniform(), key, rays);
  sink.cost().add(rays);
  if (!point) return;
  const auto seen =
      film_point(context_.scene, point->face, point->x, sample_lens(context_.scene.camera, key));
  if (!seen || !sink.at(seen->at)) return;
  const Vec3d q = value(seen->ray.origin);
  const Rgb<double> amount = edges_.difference(edge, *point, q, seen->omega);
  const double scale = film_per_solid_angle(context_.scene.camera, seen->omega, seen->distance) /
                       (edges_.probability(chosen) * share);
  if (is_black(amount)) return;
  const BoundaryForm form = sweep(edge, *point, {seen->omega, seen->distance}, scale);
  if (!sink.takes(form, key)) return;
  RayCount shadow;
  const Ray ray = ray_to(context_.scene, aimed_at(*seen, point->target(q)), point->face);
  const auto got = share_along(context_, ray, 0, shadow);
  sink.cost().add(shadow);
  if (got) sink.add(amount * *got);
}

// The viewer q of the shadow is itself a point of a face, as the camera's ray carries it.
void ShadowTerm::add_line(double u, const Rng& key, FilmSink& sink) const {
  const Scene& scene = context_.scene;
  const uint32_t chosen = edges_.choose(u);
  const ShadowEdge& edge = edges_.edge(chosen);
  Rng rng = key.at(Purpose::kShadow, 0);
  const double t = rng.uniform(), u_0 = rng.uniform(), u_1 = rng.uniform();
  RayCount rays;
  const auto point = edges_.cast(edge, t, key, rays);
  const auto vertex =
      point ? lines_.draw(edge, *point, u_0, u_1, sample_lens(scene.camera, key), rays)
            : std::nullopt;
  sink.cost().add(rays);
  if (!vertex || !sink.at(vertex->seen.at)) return;
  const Vec3d omega = vertex->seen.omega;
  const auto surface =
      surface_on_ray<double>(scene, vertex->face, value(vertex->seen.ray.origin), omega);
  const Scattering<double> scattering(surface, -omega, scene.shading);
  if (scattering.black()) return;
  const double distance = length(point->x - vertex->q);
  const Vec3d way = (point->x - vertex->q) / distance;
  const Rgb<double> f = scattering.eval_value(way);
  if (!(distance > 0) || is_black(f)) return;
  const double probability = edges_.probability(chosen);
  const double by_line = lines_.density(edge, *point, *vertex);
  const double share = lines_.share(edge, probability, *point, *vertex, by_line, scattering);
  const double density = ShadowLines::kShare * probability * by_line;
  const Rgb<double> amount = f * edges_.difference(edge, *point, vertex->q, way);
  if (is_black(amount) || !(density > 0)) return;
  BoundaryForm form = sweep(edge, *point, {way, distance}, share / density);
  form.turn_at(vertex->q, form.x);
  form.x = vertex->q;
  form.distance = vertex->seen.distance;
  form.add_seen_point(scene, vertex->face, omega, form.of_ray());
  if (!sink.takes(form, key)) return;
  RayCount shadow;
  const bool hidden = is_hidden(context_, vertex->seen, vertex->face, shadow);
  sink.cost().add(shadow);
  if (!hidden) sink.add(amount);
}

}  // namespace

std::unique_ptr<Term> make_shadow_term(TermInput& input) {
  return std::make_unique<ShadowTerm>(input);
}

}  // namespace limn
