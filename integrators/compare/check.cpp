// A gradient against differences: z-scores over blocks of pixels, and whom to suspect.
#include "limn/integrators/check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/parameter.h"

namespace limn {
namespace {

// The chance that a right gradient is accused, of each of the tests.
constexpr double kLevel = 1e-4;

// The variance of a block's difference between gradient and differences, with lower limits that the
// batches may not show. Under the hypothesis that the gradient is right, an edge gives events of
// size x [per sample] at such a rate that their mean is the edge's part of the derivative: a variance
// of at least |mean| x / spp, even where no event has come yet. And a difference of two images of
// radiance L over 2 h is rounded to some hundred units in the last place of L / h.
struct BlockVariance {
  const GradientResult& result;
  const ParameterGradient& gradient;
  std::vector<double> radiance;  // of the blocks
  double step;
  bool all_edges;  // the gradient has no part but rare events, as differences have

  double operator()(const DifferenceEstimate& differences, size_t block) const {
    const Moments& blocks = differences.blocks;
    const double edges = edge_magnitude(result, gradient, block);
    const double rounding = 0x1p-44 * radiance[block] / step;
    const double of_differences = std::max(
        blocks.variance(block), edges * differences.events.large_size() / blocks.samples());
    const Moments& own = gradient.total_blocks;
    double of_gradient = own.variance(block);
    if (all_edges) {
      of_gradient = std::max(of_gradient, std::fabs(blocks.mean(block)) *
                                              gradient.events.large_size() / own.samples());
    }
    return of_gradient + of_differences + rounding * rounding;
  }
};

std::vector<double> z_scores(const DifferenceEstimate& estimate, const BlockVariance& variance) {
  const Moments& differences = estimate.blocks;
  const Moments& gradient = variance.gradient.total_blocks;
  std::vector<double> z;
  for (size_t b = 0; b < gradient.size(); ++b) {
    const double residual = gradient.mean(b) - differences.mean(b);
    const double both = variance(estimate, b);
    if (both == 0 && residual == 0) continue;
    z.push_back(normal_from_student(residual / std::sqrt(both), gradient.batches() - 1));
  }
  return z;
}

Suspicion regress(const Moments& term, const DifferenceResult& differences,
                  const BlockVariance& variance) {
  const Moments& gradient = variance.gradient.total_blocks;
  const DifferenceEstimate& estimate = differences.extrapolated;
  const Moments& blocks = estimate.blocks;
  double product = 0;
  double square = 0;
  for (size_t b = 0; b < term.size(); ++b) {
    const double both = variance(estimate, b);
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
  return sum_blocks(means(result.gradient.radiance), film.crop_width, film.crop_height,
                    result.block);
}

// The terms that were left out.
GradientResult other_terms(const Scene& scene, const GradientResult& result,
                           GradientOptions options, RunSettings settings) {
  options.terms.clear();
  for (const TermRun& term : result.terms) {
    if (!term.computed) options.terms.push_back(term.name);
  }
  settings.progress = nullptr;
  return gradient(scene, options, settings);
}

// Sets the suspicions, and the suspect among them.
void suspect_terms(const Scene& scene, const GradientOptions& options, const RunSettings& settings,
                   const BlockVariance& variance, CheckResult& result) {
  const std::vector<TermRun>& terms = result.gradient.terms;
  // A term that was left out may be the one that is missing.
  std::optional<GradientResult> others;
  double largest = -1;
  for (size_t t = 0; t < terms.size(); ++t) {
    if (!terms[t].computed && !others) {
      others = other_terms(scene, result.gradient, options, settings);
    }
    const GradientResult& from = terms[t].computed ? result.gradient : *others;
    const Suspicion suspicion =
        regress(from.parameters[0].term_blocks[t], result.differences, variance);
    result.suspicions.push_back(suspicion);
    if (std::fabs(suspicion.z) > largest) {
      largest = std::fabs(suspicion.z);
      result.suspect = terms[t].name;
    }
  }
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
  gradient_options.method = options.method;
  gradient_options.block = result.block;
  gradient_options.samples = options.samples;
  result.gradient = gradient(scene, gradient_options, first);
  result.differences =
      finite_differences(scene, options.parameter, result.step, result.block, second);

  const ParameterGradient& g = result.gradient.parameters[0];
  const DifferenceResult& d = result.differences;
  const auto slides = [](const TermRun& term) { return term.computed && !term.edges; };
  const auto& terms = result.gradient.terms;
  const BlockVariance variance{result.gradient, g, block_means(result, scene.film), result.step,
                               std::none_of(terms.begin(), terms.end(), slides)};
  result.at_step = summarize(z_scores(d.at_step, variance));
  result.at_double_step = summarize(z_scores(d.at_double_step, variance));
  result.extrapolated = summarize(z_scores(d.extrapolated, variance));
  result.total = compare_totals(g.image_sum, d.extrapolated.image_sum);
  // Extrapolation only helps where the double step is still small; a wrong gradient agrees with
  // neither.
  const bool blocks_agree =
      result.at_step.plausible(kLevel) || result.extrapolated.plausible(kLevel);
  result.agree = blocks_agree && normal_p_value(result.total.z) >= kLevel;
  if (!result.agree) suspect_terms(scene, gradient_options, first, variance, result);
  return result;
}

}  // namespace limn
