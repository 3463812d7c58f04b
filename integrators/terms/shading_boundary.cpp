// The boundary term of shading points: some samples of it at every vertex of a path, weighed by the
// path's throughput. What regions of light emit is left to direct_boundary.cpp, where they are apart.
//   dL_o/dtheta  +=  sum over edges of the integral over t of dL(t) f_s(w_t) J(t) dt,
//   J(t) = det(w_0, w_1, v) / |w|^3
#include <fmt/format.h>

#include <limits>

#include "integrators/terms/edge_jump.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_query.h"

namespace limn {
namespace {

class BoundaryTerm final : public Term {
 public:
  explicit BoundaryTerm(TermInput& input)
      : context_(input.context),
        edges_(input.edges()),
        sampler_(input.edge_sampler()),
        build_seconds_(input.edge_sampler_seconds()),
        part_{input.regions()} {}

  bool uses_vertices() const override { return true; }
  void add_at_vertex(const PathVertex& vertex, int samples, TermCost& cost,
                     Rgb<Lanes>& sum) const override {
    if (is_left_out(vertex.bounces)) return;
    const EdgeQuery query = query_at(vertex);
    for (int i = 0; i < samples; ++i) {
      add_sample(vertex, query, vertex.key.copy(Purpose::kEdgeCopy, i), cost, sum);
    }
  }

  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) +
           sampler_.draw_cost() * static_cast<double>(cost.samples);
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
    return part_.regions && part_.regions->hold_all() && max_depth >= 0 && bounces + 2 >= max_depth;
  }
  void add_sample(const PathVertex& vertex, const EdgeQuery& query, const Rng& key, TermCost& cost,
                  Rgb<Lanes>& sum) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
  double build_seconds_;
  RadiancePart part_;
};

void BoundaryTerm::add_sample(const PathVertex& vertex, const EdgeQuery& query, const Rng& key,
                              TermCost& cost, Rgb<Lanes>& sum) const {
  ++cost.samples;
  Rng rng = key.at(Purpose::kEdge, vertex.bounces);
  const std::optional<EdgeSample> drawn = sampler_.sample(query, rng);
  if (!drawn) {
    ++cost.no_edge;
    if (vertex.log) vertex.log->push_back("  edge: none found");
    return;
  }
  const EdgeSample& sample = *drawn;
  const EdgeMesh& mesh = edges_.object(sample.edge.object);
  EdgeView view;
  const bool seen = view_edge(mesh, sample.edge, sample.t, query.p, view);
  const auto [a, b] = mesh.edge(sample.edge.edge).vertices;
  const Vec3<Lanes> v = relative_velocity(mesh, a, query) * (1 - sample.t) +
                        relative_velocity(mesh, b, query) * sample.t;
  const Lanes weight =
      (v.x * view.side.x + v.y * view.side.y + v.z * view.side.z) *
      (1 / (view.distance * view.distance * view.distance * sample.probability * sample.pdf_t));
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "  edge {} of shape {} at t = {:.6g}: probability {:.4g}, density of t {:.4g}, distance "
        "{:.6g}",
        sample.edge.edge.index(), sample.edge.object.index(), sample.t, sample.probability,
        sample.pdf_t, view.distance));
  }
  // A density may round to zero at the very horizon.
  const Rgb<double> f =
      seen && sample.pdf_t > 0 ? value(vertex.scattering.eval(view.omega)) : Rgb<double>{};
  if (is_zero(weight) || is_black(f)) {
    ++cost.zero_weight;
    if (vertex.log) vertex.log->push_back("    no weight");
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context_, mesh, view, query.face, 0, std::numeric_limits<double>::infinity(),
                vertex.bounces + 1, key, rays, jump, part_);
  cost.add(rays);
  if (!visible) {
    ++cost.occluded;
    if (vertex.log) vertex.log->push_back("    hidden");
    return;
  }
  ++cost.counted;
  const Rgb<double> amount = vertex.throughput * f * jump;
  const Rgb<Lanes> added{weight * amount.r, weight * amount.g, weight * amount.b};
  if (vertex.log) {
    vertex.log->push_back(fmt::format(
        "    jump ({:.6g}, {:.6g}, {:.6g}), adds ({:.6g}, {:.6g}, {:.6g}) to the first parameter",
        jump.r, jump.g, jump.b, added.r[0], added.g[0], added.b[0]));
  }
  sum = sum + added;
}

}  // namespace

std::unique_ptr<Term> make_boundary_term(TermInput& input) {
  return std::make_unique<BoundaryTerm>(input);
}

}  // namespace limn
