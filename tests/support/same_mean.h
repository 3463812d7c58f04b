#pragma once
// Runs of methods: whether they have the mean of the plain forest, or the same bits.
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "limn/integrators/statistics.h"
#include "support/block_runs.h"

namespace limn {

// With samples of each term as a method chooses them.
inline GradientResult run_method(const Scene& scene, const std::vector<std::string>& parameters,
                                 const std::string& method, int spp, uint64_t seed, int threads = 2,
                                 const std::vector<std::string>& terms = {}) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = method;
  options.samples = std::nullopt;
  options.terms = terms;
  return run_blocks(scene, options, spp, seed, threads);
}

inline void expect_same_bits(const GradientResult& a, const GradientResult& b) {
  for (size_t k = 0; k < a.parameters.size(); ++k) {
    const Moments &first = a.parameters[k].total, &second = b.parameters[k].total;
    for (size_t i = 0; i < first.size(); ++i) {
      ASSERT_EQ(first.mean(i), second.mean(i)) << a.parameters[k].name;
      ASSERT_EQ(first.variance(i), second.variance(i)) << a.parameters[k].name;
    }
  }
}

// z-scores of the differences of block sums between a method and the plain forest.
inline void expect_same_mean(const Scene& scene, const std::vector<std::string>& parameters,
                             const std::vector<std::string>& methods, int spp = 256) {
  const GradientResult plain = run_method(scene, parameters, "forest", spp, 1);
  for (const std::string& method : methods) {
    const GradientResult moving = run_method(scene, parameters, method, spp, 2);
    for (size_t k = 0; k < parameters.size(); ++k) {
      const Moments &a = plain.parameters[k].total_blocks, &b = moving.parameters[k].total_blocks;
      std::vector<double> z;
      for (size_t i = 0; i < a.size(); ++i) {
        const double variance = a.variance(i) + b.variance(i);
        if (variance == 0) continue;
        z.push_back(normal_from_student((a.mean(i) - b.mean(i)) / std::sqrt(variance),
                                        std::min(a.degrees(), b.degrees())));
      }
      const ZSummary summary = summarize(z);
      const std::string label = method + " " + parameters[k];
      EXPECT_GE(summary.count, 4) << label;
      EXPECT_GE(summary.p_largest, 1e-6) << label << ": " << summary.largest;
      EXPECT_LE(std::fabs(summary.mean) * std::sqrt(static_cast<double>(summary.count)), 5)
          << label;
    }
  }
}

}  // namespace limn
