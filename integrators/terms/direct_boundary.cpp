// The boundary term of light that shading points see directly from regions: all silhouettes inside
// a region's cone are listed, and points on them drawn by what each would add.
//   dL_o/dtheta  +=  sum over regions k of the sum over edges of
//                    the integral over t of dL_k(t) f_s(w_t) J(t) dt
// dL_k, the difference of what region k emits and p sees directly, is zero but on outlines inside
// the cone of directions around the region (those of the emitter itself are on its boundary). With
// weights W_i of the pieces i of these, W their sum, N points u_j = (j + xi) / N of the cumulated
// weights, in the order of the list, estimate the sum: each piece is drawn N W_i / W times on
// average. The order is the trees': points that follow each other lie near each other in the scene.
// A vertex may have its list with a probability alone, by which it divides.
#include <fmt/format.h>

#include <algorithm>

#include "integrators/terms/direct_edges.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/term_table.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {
namespace {

// What a list costs per point, in the unit of Term::work: timed as 0.2 (the sun), 1.0 (soft
// shadow), 1.9 (CAD part), 3.3 (plant), 3.5 (four emitters), against draws of the forest.
constexpr double kListCost = 1;

// A list takes time for every silhouette before an emitter, and what it adds at later vertices is
// scattered once more. Where more than kShort edges lie before emitters, a later vertex has a list
// with the probability kShort over their number, at least kLeast; a first vertex with four times
// it. In a room of 45,000 edges and 13 lamps (6,356 pieces in a list) lists took 94 % of the time,
// for 9 % of the variance.
constexpr double kShort = 16000;
constexpr double kLeast = 1.0 / 16;

class DirectTerm final : public Term {
 public:
  explicit DirectTerm(TermInput& input)
      : context_(input.context),
        edges_(input.edges()),
        regions_(*input.regions()),
        ways_(emitter_ways(context_, edges_, regions_, *input.emitter_edges())),
        direct_(edges_, input.edge_sampler(), regions_),
        later_share_(
            std::clamp(kShort / static_cast<double>(input.emitter_edges()->size()), kLeast, 1.0)) {}

  bool uses_vertices() const override { return true; }
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const override;
  double work(const TermCost& cost) const override {
    return static_cast<double>(cost.rays) + kListCost * static_cast<double>(cost.samples);
  }

 private:
  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  EmitterWays ways_;
  DirectEdges direct_;
  double later_share_;  // of later vertices, that have a list
};

void DirectTerm::add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const {
  const double listed = vertex.bounces == 0 ? std::min(1.0, 4 * later_share_) : later_share_;
  if (listed < 1) {
    const Rng key = vertex.key.at(Purpose::kDirect, vertex.bounces).at(Purpose::kDirect, 1);
    if (Rng(key).uniform() >= listed) return;
  }
  static thread_local DirectPieces pieces;
  static thread_local std::vector<DirectPoint> points;
  // The light of emitters is seen in directions that are held, see path.h.
  const EdgeQuery turning = query_at(vertex);
  EdgeQuery held = turning;
  held.turn = {};
  const double u =
      regions_.chooses()
          ? vertex.key.at(Purpose::kDirect, vertex.bounces).at(Purpose::kDirect, 0).uniform()
          : 0;
  direct_.list(held, turning, u, pieces);
  if (sink.log()) {
    sink.log()->push_back(fmt::format("  direct: {} pieces of silhouettes before {} regions",
                                      pieces.others.size() + pieces.outlines.size(),
                                      regions_.size()));
  }
  direct_.draw(pieces, vertex.key, vertex.bounces, samples, sink.cost(), points);
  for (const DirectPoint& point : points) {
    const double share = is_lifted(context_.scene, vertex.surface.face.shape)
                             ? 1
                             : direct_share(ways_, point.sample, point.region, vertex.surface,
                                            vertex.step, vertex.bounces);
    const EdgeDraw draw{edges_.object(point.sample.edge.object),
                        point.sample,
                        {&regions_, point.region},
                        vertex.key,
                        share / listed,
                        regions_.shape(point.region).valid()};
    add_edge_point(context_, vertex, draw, sink);
  }
}

}  // namespace

std::unique_ptr<Term> make_direct_term(TermInput& input) {
  return std::make_unique<DirectTerm>(input);
}

}  // namespace limn
