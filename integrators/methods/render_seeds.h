#pragma once
// Images of one scene by several seeds: what they are made with is built once.
#include <memory>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "limn/core/scene.h"
#include "limn/integrators/render.h"

namespace limn {

// Not for methods that look around, whose estimators hold their seed.
class SeedImages {
 public:
  // settings: threads. InputError as render().
  SeedImages(Scene scene, const RunSettings& settings, const RenderOptions& options);
  SeedImages(const SeedImages&) = delete;
  SeedImages& operator=(const SeedImages&) = delete;
  // The bits of render() with these settings, of no part of a store.
  RenderResult render(const RunSettings& settings) const;

 private:
  RenderOptions options_;
  Scene scene_;
  std::vector<std::unique_ptr<SampleEstimator>> estimators_;
};

// Each has the bits of render() with this seed in place of settings.seed, and takes no part of a
// store. A limit of time is that of each, with its share of the set-up; its samples are then as
// many as fit. InputError as render().
std::vector<RenderResult> render_seeds(const Scene& scene, const RunSettings& settings,
                                       std::span<const uint64_t> seeds,
                                       const RenderOptions& options);

}  // namespace limn
