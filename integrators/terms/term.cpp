// The table of terms, and what they are made from.
#include "integrators/terms/term.h"

#include "integrators/terms/scene_edges.h"
#include "integrators/terms/term_table.h"

namespace limn {

static_assert(std::size(kTermTypes) <= kMostTerms);

std::span<const TermType> term_types() { return kTermTypes; }

const EdgeSamplerInput& TermInput::edges() {
  if (edges_) return *edges_;
  const Stopwatch watch;
  edges_ = std::make_unique<EdgeSamplerInput>(make_sampler_input(context.scene, threads));
  edges_->lane_scale = lane_scale;
  edges_seconds_ = watch.seconds();
  return *edges_;
}

}  // namespace limn
