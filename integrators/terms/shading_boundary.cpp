// The boundary term of shading points: some samples of it at every vertex of a path, weighed by the
// path's throughput. What regions of light emit is left to direct_boundary.cpp, where they are
// apart.
//   dL_o/dtheta  +=  sum over edges of the integral over t of dL(t) f_s(w_t) J(t) dt,
//   J(t) = det(w_0, w_1, v) / |w|^3
// Samples of the film draw lines from edges beside glossy faces to vertices that the camera sees
// (gloss_lines.h).
#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "integrators/terms/gloss_lines.h"
#include "integrators/terms/highlight_edges.h"
#include "integrators/terms/mirror_edges.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

class BoundaryTerm final : public Term {
 public:
  explicit BoundaryTerm(TermInput& input)
      : context_(input.context),
        edges_(input.chosen_edges()),
        sampler_(input.edge_sampler()),
        build_seconds_(input.edge_sampler_seconds()),
        part_{input.regions()},
        nothing_(input.warps && std::all_of(edges_.objects.begin(), edges_.objects.end(),
                                            [](const EdgeMesh& m) { return m.edges.empty(); })) {
    if (context_.flat_mirrors) mirrors_.emplace(context_, edges_, sampler_);
    if (context_.mirrored)
      highlights_.emplace(context_.scene, edges_, sampler_, *context_.mirrored);
    discontinuous_emitters_ = std::ranges::any_of(edges_.objects, [&](const EdgeMesh& mesh) {
      return is_textured_emitter(mesh) && (mesh.of_texture() || mesh.count(EdgeClass::kSharp) > 0);
    });
    if (input.sampler.regions && !input.warps && !context_.straight_ways && scatters_again(0) &&
        !is_left_out(0)) {
      lines_.emplace(context_, edges_, input.free != nullptr);
      if (lines_->empty()) lines_.reset();
    }
  }

  bool uses_film() const override { return lines_.has_value(); }
  void sample_film(double u, const Rng& key, FilmSink& sink) const override;

  bool uses_vertices() const override { return !nothing_; }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override {
    if (mirrors_) mirrors_->add_at_vertex(vertex, samples, sink);
    if (is_left_out(vertex.bounces)) return;
    static thread_local HighlightEdges::View view;
    const EdgeQuery query = query_at(vertex);
    const bool looks = highlights_ && scatters_again(vertex.bounces);
    if (looks) add_before_highlights(vertex, query, samples, view, sink);
    add_draws(vertex, query, samples, looks ? &view : nullptr, sink);
  }

  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) +
           sampler_.draw_cost() * static_cast<double>(cost.samples) + first_work(cost);
  }
  double first_work(const TermCost& cost) const override {
    return sampler_.query_cost() * static_cast<double>(cost.samples);
  }

  void describe(GradientStats& stats) const override {
    stats.setup.emplace_back("edge sampler", build_seconds_);
    const SamplerSize size = sampler_.size();
    stats.sampler_nodes += size.nodes;
    stats.sampler_bytes += size.bytes;
  }

 private:
  // Whether what arrives at a vertex is what regions emit, and nothing else.
  bool is_left_out(int bounces) const {
    const int max_depth = context_.scene.max_depth;
    return part_.regions && part_.regions->hold_all() && !discontinuous_emitters_ &&
           max_depth >= 0 && bounces + 2 >= max_depth;
  }
  // Whether what a direction from a vertex meets is lit by what it scatters.
  bool scatters_again(int bounces) const {
    const int max_depth = context_.scene.max_depth;
    return max_depth < 0 || bounces + 2 < max_depth;
  }
  // view: replaced.
  void add_before_highlights(const PathVertex& vertex, const EdgeQuery& query, int samples,
                             HighlightEdges::View& view, BoundarySink& sink) const;
  // view: what is left out, if anything.
  void add_draws(const PathVertex& vertex, const EdgeQuery& query, int samples,
                 const HighlightEdges::View* view, BoundarySink& sink) const;
  bool is_textured_emitter(const EdgeMesh& mesh) const {
    if (!mesh.shape.valid()) return false;
    const Shape& shape = context_.scene.shape(mesh.shape);
    return shape.is_emitter && shape.mesh.textured;
  }
  // What a point on an edge adds, but for what regions emit: lists of outlines have that. They have
  // no edges inside a textured emitter, so what its texture emits on either side is added here, in
  // directions that are held, see path.h.
  void add_drawn(const PathVertex& vertex, const EdgeSample& sample, const Rng& key, bool roulette,
                 BoundarySink& sink) const {
    const EdgeMesh& mesh = edges_.object(sample.edge.object);
    EdgeDraw draw{mesh, sample, part_, key};
    draw.roulette = roulette;
    draw.share = 1 - share_of_lines(vertex, sample);
    add_edge_point(context_, vertex, draw, sink);
    if (!discontinuous_emitters_ || !part_.regions || !is_textured_emitter(mesh)) return;
    if (is_outline(mesh, sample.edge.edge, vertex.surface.p)) return;
    for (size_t k = 0; k < part_.regions->size(); ++k) {
      if (part_.regions->shape(k) != mesh.shape) continue;
      draw.part.region = k;
      draw.held = true;
      add_edge_point(context_, vertex, draw, sink);
    }
  }

  double share_of_lines(const PathVertex& vertex, const EdgeSample& sample) const {
    if (!lines_ || vertex.bounces > 0) return 0;
    const auto seen = seen_vertex(context_.scene, vertex.surface.face, vertex.surface.p,
                                  sample_lens(context_.scene.camera, vertex.key));
    return seen ? lines_->share({sample.edge, sample.t, *seen}).share : 0;
  }

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
  double build_seconds_;
  RadiancePart part_;
  std::optional<MirrorEdges> mirrors_;        // none where there are no flat ones
  std::optional<HighlightEdges> highlights_;  // none where nothing mirrors
  std::optional<GlossLines> lines_;           // none where no gloss is beside an edge
  bool nothing_;                              // warped directions follow all edges
  bool discontinuous_emitters_;               // some may be, by their textures
};

void BoundaryTerm::sample_film(double u, const Rng& key, FilmSink& sink) const {
  constexpr double kLeastShare = 0.1;  // lines of less go on by roulette; not tuned
  const Scene& scene = context_.scene;
  Rng rng = key.at(Purpose::kShadow, 0);
  RayCount rays;
  const auto line = lines_->draw(u, rng, sample_lens(scene.camera, key), rays);
  sink.cost().add(rays);
  if (!line || !sink.at(line->vertex.seen.at)) return;
  const auto& [face, q, seen] = line->vertex;
  const auto [density, share] = lines_->share(*line);
  if (!(rng.uniform() * kLeastShare < share)) return;
  const auto surface = surface_on_ray<double>(scene, face, value(seen.ray.origin), seen.omega);
  const Scattering<double> scattering(surface, -seen.omega, scene.shading);
  if (scattering.black()) return;
  RayCount shadow;
  const bool hidden = is_hidden(context_, seen, face, shadow);
  sink.cost().add(shadow);
  if (hidden) return;
  const EdgeSample sample{line->edge, line->t, density / std::max(share, kLeastShare), 1};
  const EdgeMesh& mesh = edges_.object(line->edge.object);
  const auto& ends = mesh.edge(line->edge.edge).vertices;
  PathVertex vertex{surface, scattering, grey(1.0), {}, {}, 0, {}, key};
  vertex.below = scattering.passes(mesh.position(ends[0]) * (1 - line->t) +
                                   mesh.position(ends[1]) * line->t - q);
  const SeenAlong along{seen.omega, seen.distance};
  EdgeDraw draw{mesh, sample, part_, key};
  draw.along = &along;
  add_edge_point(context_, vertex, draw, sink);
}

void BoundaryTerm::add_before_highlights(const PathVertex& vertex, const EdgeQuery& query,
                                         int samples, HighlightEdges::View& view,
                                         BoundarySink& sink) const {
  static thread_local std::vector<DirectPoint> points;
  highlights_->list(vertex, query, view);
  if (view.count == 0) return;
  if (sink.log()) {
    sink.log()->push_back(
        fmt::format("  {} pieces of silhouettes in front of highlights", view.pieces.size()));
  }
  // Not the numbers of `direct`, whose copies begin with the first.
  const Rng key = vertex.key.at(Purpose::kDirectCopy, 0);
  highlights_->draw(view, query, key.at(Purpose::kDirect, vertex.bounces), samples, sink.cost(),
                    points);
  for (size_t i = 0; i < points.size(); ++i) {
    const Rng own = key.copy(Purpose::kEdgeCopy, static_cast<int>(i));
    add_drawn(vertex, points[i].sample, own, false, sink);
  }
}

void BoundaryTerm::add_draws(const PathVertex& vertex, const EdgeQuery& query, int samples,
                             const HighlightEdges::View* view, BoundarySink& sink) const {
  static thread_local std::vector<std::optional<EdgeSample>> drawn;
  draw_edges(sampler_, query, vertex.key, vertex.bounces, samples, drawn);
  TermCost& cost = sink.cost();
  cost.samples += drawn.size();
  for (int i = 0; i < samples; ++i) {
    if (!drawn[i]) {
      ++cost.no_edge;
      if (sink.log()) sink.log()->push_back("  edge: none found");
    } else if (view && highlights_->hold(*view, query, *drawn[i])) {
      ++cost.zero_weight;
      if (sink.log()) sink.log()->push_back("  edge: in front of a highlight, left to others");
    } else {
      add_drawn(vertex, *drawn[i], vertex.key.copy(Purpose::kEdgeCopy, i), true, sink);
    }
  }
}

}  // namespace

std::unique_ptr<Term> make_boundary_term(TermInput& input) {
  return std::make_unique<BoundaryTerm>(input);
}

}  // namespace limn
