#pragma once
// Edges that vertices of paths see by way of chains of flat mirrors.
#include "integrators/terms/vertex_edges.h"

namespace limn {

class MirrorEdges {
 public:
  // All must outlive it; the context has flat mirrors.
  MirrorEdges(const PathContext& context, const EdgeSamplerInput& edges, const EdgeSampler& sampler)
      : context_(context), edges_(edges), sampler_(sampler) {}

  // Takes `samples` draws by way of one chain, which is chosen by chance, and hands them on.
  void add_at_vertex(const PathVertex& vertex, int samples, BoundarySink& sink) const;

 private:
  struct Choice {
    size_t chain;
    double probability;
  };
  std::optional<Choice> choose(const PathVertex& vertex, double u) const;
  // About how much of what arrives comes by way of a chain: 0 only where nothing does.
  double importance(const FlatMirrors::Chain& chain, const PathVertex& vertex) const;
  bool is_before_mirror(const MirrorWay& way, const EdgeSample& sample) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
};

}  // namespace limn
