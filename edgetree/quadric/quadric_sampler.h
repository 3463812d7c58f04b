#pragma once
// The forest of Soroka, Peters, Marschner 2025, as the paper has it: the baseline that the edge
// forest comes from (edgetree/README.md says where they differ).
#include <memory>
#include <vector>

#include "edgetree/quadric/quadric_config.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

class QuadricSampler final : public EdgeSampler {
 public:
  // The input must outlive it. The result does not depend on `threads`.
  static std::unique_ptr<QuadricSampler> build(const EdgeSamplerInput& input, int threads,
                                               const QuadricConfig& config = {});
  ~QuadricSampler() override;

  std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const override;
  double probability(const EdgeQuery& query, EdgeRef edge) const override;
  double pdf_t(const EdgeQuery& query, EdgeRef edge, double t) const override;
  // A walk down the trees costs a handful of rays.
  double draw_cost() const override { return 5; }
  // First draws took 2 (demo, near mirror) and 16 (CAD part) more than further ones, which took 5,
  // 7 and 50: what is near by then.
  double query_cost() const override { return 2; }
  SamplerSize size() const override;
  std::unique_ptr<RejectionTree> rejection_tree() const override;

 private:
  struct Impl;
  explicit QuadricSampler(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn
