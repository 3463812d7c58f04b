#pragma once
// The paper's forest (Soroka, Peters, Marschner 2025): the baseline that the edge forest is derived
// from (differences are listed in edgetree/README.md).
#include <memory>

#include "edgetree/quadric/quadric_node.h"
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
  // A descent costs a few rays.
  double draw_cost() const override { return 5; }
  // First draws cost 2 (demo, near mirror) to 16 (CAD part) more than further ones, which cost 5, 7
  // and 50; their nodes are cached by then.
  double query_cost() const override { return 2; }
  SamplerSize size() const override;
  std::unique_ptr<RejectionTree> rejection_tree() const override;

 private:
  struct Impl;
  explicit QuadricSampler(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn
