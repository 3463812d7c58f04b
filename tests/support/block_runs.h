#pragma once
// Gradients with sums over blocks of pixels, to compare two ways to the same.
#include <gtest/gtest.h>

#include "limn/integrators/gradient.h"

namespace limn {

inline GradientResult run_blocks(const Scene& scene, const std::vector<std::string>& parameters,
                                 int spp, uint64_t seed) {
  GradientOptions options;
  options.parameters = parameters;
  options.block = 4;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  return result;
}

}  // namespace limn
