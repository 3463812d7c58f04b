#pragma once
// The edge forest: 8-wide trees over the edges of a scene that find silhouettes in logarithmic time
// and reject what has none (after Soroka, Peters, Marschner 2025; edgetree/README.md says where it
// departs from the paper).
#include <cstdint>
#include <memory>
#include <vector>

#include "limn/edgetree/edge_sampler.h"

namespace limn {

// What is built and how children are weighed. The defaults are what pays; the rest is for
// comparison. No choice biases an estimate.
struct ForestConfig {
  // Dual boxes along the principal axes of a node's planes; else along any axes.
  bool principal_axes = true;
  // Children weigh by how deep the query plane cuts their dual box; else all that are not rejected
  // weigh by length and distance alone.
  bool soft_weights = true;
  // Children weigh by the light that may come from behind them.
  bool light_term = true;
  // The same for an environment that is not uniform.
  bool environment_term = true;
  // Children of a node, 2 to 8.
  uint32_t width = 8;
  // Children of at most this height weigh by the lengths that their own children expect, which for
  // nodes of edges (height 0) are exact: -1 for none, kAnyHeight for all. Fewer draws end without
  // an edge, at the price of more nodes read.
  static constexpr int kAnyHeight = 255;
  int look_ahead = 2;
  // Concave smooth edges of closed one-sided meshes are left out.
  bool cull_concave = true;
};

class EdgeForest final : public EdgeSampler {
 public:
  // The input must outlive the forest. The result does not depend on `threads`.
  static std::unique_ptr<EdgeForest> build(const EdgeSamplerInput& input, int threads,
                                           const ForestConfig& config = {});
  ~EdgeForest() override;

  bool sample(const EdgeQuery& query, Rng& rng, EdgeSample& sample) const override;
  double probability(const EdgeQuery& query, EdgeId edge) const override;
  double pdf_t(const EdgeQuery& query, EdgeId edge, double t) const override;
  std::unique_ptr<RejectionTree> rejection_tree() const override;

  // All of E(p), without regard to occlusion, horizon or motion, in the order of the trees. Appends
  // and returns the number of nodes (of up to eight children) that were tested.
  uint64_t list_silhouettes(const Vec3d& p, std::vector<EdgeId>& edges) const;

  // Of everything that the forest allocates beside its input.
  uint64_t bytes() const;
  uint64_t node_count() const;

 private:
  struct Impl;
  explicit EdgeForest(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace limn
