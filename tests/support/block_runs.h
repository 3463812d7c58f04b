#pragma once
// Gradients with sums over blocks of pixels, to compare two ways to the same.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/integrators/gradient.h"
#include "support/compare_moments.h"

namespace limn {

// By blocks of four pixels. Expects that all is finite.
inline GradientResult run_blocks(const Scene& scene, GradientOptions options, int spp,
                                 uint64_t seed, int threads = 1) {
  options.block = 4;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  GradientResult result = gradient(scene, options, settings);
  EXPECT_EQ(result.non_finite.count, 0u) << result.non_finite.message();
  return result;
}
inline GradientResult run_blocks(const Scene& scene, const std::vector<std::string>& parameters,
                                 int spp, uint64_t seed) {
  GradientOptions options;
  options.parameters = parameters;
  return run_blocks(scene, options, spp, seed);
}

// The whole image, and blocks where these say something; b times b_scale should be a. A right
// program fails either with a chance of 1e-4.
inline void expect_equal(const ParameterGradient& a, const ParameterGradient& b, double b_scale = 1,
                         bool by_blocks = true) {
  constexpr double kLevel = 1e-4;
  const ZSummary blocks = compare_moments(a.total_blocks, b.total_blocks, b_scale);
  const ZSummary image = compare_moments(a.image_sum, b.image_sum, b_scale);
  fmt::print(
      "{:24} {:3} blocks, mean z {:5.2f}, sd {:4.2f}, max |z| {:5.2f}; image {:9.4g} +- {:7.2g}, "
      "other {:9.4g} +- {:7.2g}, z {:5.2f}\n",
      a.name, blocks.count, blocks.mean, blocks.deviation, blocks.largest, a.image_sum.mean(0),
      std::sqrt(a.image_sum.variance(0)), b_scale * b.image_sum.mean(0),
      b_scale * std::sqrt(b.image_sum.variance(0)), image.mean);
  EXPECT_GT(blocks.count, 0) << a.name;
  if (by_blocks) {
    EXPECT_TRUE(blocks.plausible(kLevel)) << a.name;
  }
  EXPECT_TRUE(image.plausible(kLevel)) << a.name;
}

}  // namespace limn
