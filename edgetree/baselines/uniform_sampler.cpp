// Uniform sampling of edges: the baseline that every other sampler must beat.
#include <algorithm>

#include "edgetree/baselines/baselines.h"

namespace limn {
namespace {

// Draws every edge with equal probability; rejects a draw that is no candidate.
class UniformSampler final : public EdgeSampler {
 public:
  explicit UniformSampler(const EdgeSamplerInput& input) : input_(input) {
    for (const EdgeMesh& mesh : input.objects) ends_.push_back(count() + mesh.edges.size());
  }

  std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const override {
    if (count() == 0) return std::nullopt;
    const double u_edge = rng.uniform();
    const auto index =
        std::min(static_cast<uint64_t>(u_edge * static_cast<double>(count())), count() - 1);
    const auto object = std::upper_bound(ends_.begin(), ends_.end(), index) - ends_.begin();
    const uint64_t begin = object == 0 ? 0 : ends_[object - 1];
    EdgeSample sample;
    sample.edge = {ShapeId(static_cast<uint32_t>(object)),
                   EdgeId(static_cast<uint32_t>(index - begin))};
    sample.t = rng.uniform();
    sample.probability = probability(query, sample.edge);
    sample.pdf_t = 1;
    if (!(sample.probability > 0)) return std::nullopt;
    return sample;
  }

  double probability(const EdgeQuery& query, EdgeRef id) const override {
    const bool drawn =
        is_candidate(input_.object(id.object), id.edge, query.p) && !is_own_edge(input_, query, id);
    return drawn ? 1 / static_cast<double>(count()) : 0;
  }

  double pdf_t(const EdgeQuery&, EdgeRef, double t) const override {
    return t >= 0 && t <= 1 ? 1 : 0;
  }

  double draw_cost() const override { return 1; }
  // The cost of setting up the query; draws share no work.
  double query_cost() const override { return 0.5; }

 private:
  uint64_t count() const { return ends_.empty() ? 0 : ends_.back(); }

  const EdgeSamplerInput& input_;
  std::vector<uint64_t> ends_;  // running count of edges per object
};

}  // namespace

std::unique_ptr<EdgeSampler> make_uniform_sampler(const EdgeSamplerInput& input, int) {
  return std::make_unique<UniformSampler>(input);
}

}  // namespace limn
