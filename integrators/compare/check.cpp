#include "limn/integrators/check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/parameter.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// The variance of a block's difference, with two lower limits that the batches may not show.
// Under the hypothesis that the gradient is right, an edge gives events of size x [per sample] at
// such a rate that their mean is the edge's part of the gradient: a variance of at least |mean| x /
// spp, even where no event has come yet. And a difference of two images of radiance L over 2 h is
// rounded to some hundred units in the last place of L / h.
struct DifferenceVariance {
  const ParameterGradient& gradient;
  std::vector<double> radiance;  // of the blocks
  double step;

  double operator()(const Moments& differences, double event, size_t block) const {
    const double edges = std::fabs(gradient.term_blocks[kCamera].mean(block)) +
                         std::fabs(gradient.term_blocks[kBoundary].mean(block));
    const double rounding = 0x1p-44 * radiance[block] / step;
    return std::max(differences.variance(block), edges * event / differences.samples()) +
           rounding * rounding;
  }
};

std::vector<double> z_scores(const DifferenceEstimate& estimate,
                             const DifferenceVariance& variance) {
  const Moments& differences = estimate.blocks;
  const Moments& gradient = variance.gradient.total_blocks;
  std::vector<double> z;
  for (size_t b = 0; b < gradient.size(); ++b) {
    const double residual = gradient.mean(b) - differences.mean(b);
    const double both =
        gradient.variance(b) + variance(differences, estimate.events.large_size(), b);
    if (both == 0 && residual == 0) continue;
    z.push_back(normal_from_student(residual / std::sqrt(both), gradient.batches() - 1));
  }
  return z;
}

Suspicion regress(const Moments& term, const DifferenceResult& differences,
                  const DifferenceVariance& variance) {
  const Moments& gradient = variance.gradient.total_blocks;
  const DifferenceEstimate& estimate = differences.extrapolated;
  const Moments& blocks = estimate.blocks;
  double product = 0;
  double square = 0;
  for (size_t b = 0; b < term.size(); ++b) {
    const double both = gradient.variance(b) + variance(blocks, estimate.events.large_size(), b);
    if (both == 0) continue;
    const double value = term.mean(b);
    const double residual = blocks.mean(b) - gradient.mean(b);
    product += value * residual / both;
    square += value * value / both;
  }
  if (square == 0) return {};
  return {product / square, product / std::sqrt(square)};
}

TotalComparison compare_totals(const Moments& gradient, const Moments& differences) {
  TotalComparison total;
  total.gradient = gradient.mean(0);
  total.difference = differences.mean(0);
  total.gradient_error = std::sqrt(gradient.variance(0));
  total.difference_error = std::sqrt(differences.variance(0));
  const double residual = total.gradient - total.difference;
  const double error = std::hypot(total.gradient_error, total.difference_error);
  total.z = residual == 0 ? 0 : normal_from_student(residual / error, gradient.batches() - 1);
  return total;
}

std::vector<double> block_means(const CheckResult& result, const Film& film) {
  const Moments& radiance = result.gradient.radiance;
  std::vector<double> means(radiance.size());
  for (size_t i = 0; i < means.size(); ++i) means[i] = radiance.mean(i);
  return sum_blocks(means, film.crop_width, film.crop_height, result.block);
}

// The terms that the options leave out.
GradientResult other_terms(const Scene& scene, GradientOptions options, RunSettings settings) {
  for (bool& term : options.terms) term = !term;
  settings.progress = nullptr;
  return gradient(scene, options, settings);
}

}  // namespace

CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings) {
  CheckResult result;
  const Parameter parameter = find_parameter(scene, options.parameter);
  const int longer = std::max(scene.film.crop_width, scene.film.crop_height);
  result.step = options.step > 0 ? options.step : parameter.natural_step;
  result.block = options.block > 0 ? options.block : std::max(1, (longer + 7) / 8);

  // The job is two runs; differences trace four images without derivatives.
  RunSettings first = settings;
  RunSettings second = settings;
  second.seed = settings.seed + 0x5eed;
  if (settings.progress) {
    first.progress = [&](double done) { settings.progress(0.5 * done); };
    second.progress = [&](double done) { settings.progress(0.5 + 0.5 * done); };
  }
  GradientOptions gradient_options;
  gradient_options.parameters = {options.parameter};
  gradient_options.terms = options.terms;
  gradient_options.sampler = options.sampler;
  gradient_options.block = result.block;
  gradient_options.samples = options.samples;
  result.gradient = gradient(scene, gradient_options, first);
  result.differences =
      finite_differences(scene, options.parameter, result.step, result.block, second);

  const ParameterGradient& g = result.gradient.parameters[0];
  const DifferenceResult& d = result.differences;
  const DifferenceVariance variance{g, block_means(result, scene.film), result.step};
  result.at_step = summarize(z_scores(d.at_step, variance));
  result.at_double_step = summarize(z_scores(d.at_double_step, variance));
  result.extrapolated = summarize(z_scores(d.extrapolated, variance));
  result.total = compare_totals(g.image_sum, d.extrapolated.image_sum);
  // Extrapolation only helps where the double step is still small; a wrong gradient agrees with
  // neither.
  const bool blocks_agree =
      result.at_step.plausible(kLevel) || result.extrapolated.plausible(kLevel);
  result.agree = blocks_agree && normal_p_value(result.total.z) >= kLevel;
  if (!result.agree) {
    // A term that was left out may be the one that is missing.
    const GradientResult others = other_terms(scene, gradient_options, first);
    for (int term = 0; term < kTermCount; ++term) {
      const auto& from = options.terms[term] ? result.gradient : others;
      result.suspicions[term] = regress(from.parameters[0].term_blocks[term], d, variance);
    }
    const auto worst = std::max_element(
        result.suspicions.begin(), result.suspicions.end(),
        [](const Suspicion& a, const Suspicion& b) { return std::fabs(a.z) < std::fabs(b.z); });
    result.suspect = static_cast<int>(worst - result.suspicions.begin());
  }
  return result;
}

}  // namespace limn
