#include "limn/integrators/check.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "limn/core/parameter.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

std::vector<double> z_scores(const Moments& gradient, const Moments& differences) {
  std::vector<double> z;
  for (size_t b = 0; b < gradient.size(); ++b) {
    const double residual = gradient.mean(b) - differences.mean(b);
    const double variance = gradient.variance(b) + differences.variance(b);
    if (variance == 0 && residual == 0) continue;
    const double t = residual / std::sqrt(variance);
    z.push_back(normal_from_student(t, gradient.batches() - 1));
  }
  return z;
}

Suspicion regress(const Moments& term, const Moments& gradient, const Moments& differences) {
  double product = 0;
  double square = 0;
  for (size_t b = 0; b < term.size(); ++b) {
    const double variance = gradient.variance(b) + differences.variance(b);
    if (variance == 0) continue;
    const double value = term.mean(b);
    const double residual = differences.mean(b) - gradient.mean(b);
    product += value * residual / variance;
    square += value * value / variance;
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

}  // namespace

CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings) {
  CheckResult result;
  const ParameterInfo parameter = find_parameter(scene, options.parameter);
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
  result.gradient = gradient(scene, gradient_options, first);
  result.differences =
      finite_differences(scene, options.parameter, result.step, result.block, second);

  const ParameterGradient& g = result.gradient.parameters[0];
  const DifferenceResult& d = result.differences;
  result.at_step = summarize(z_scores(g.total_blocks, d.blocks_at_step));
  result.at_double_step = summarize(z_scores(g.total_blocks, d.blocks_at_double_step));
  result.extrapolated = summarize(z_scores(g.total_blocks, d.blocks_extrapolated));
  result.total = compare_totals(g.image_sum, d.image_sum);
  for (int term = 0; term < kTermCount; ++term) {
    result.suspicions[term] = regress(g.term_blocks[term], g.total_blocks, d.blocks_extrapolated);
  }
  result.agree = result.extrapolated.plausible(kLevel) && normal_p_value(result.total.z) >= kLevel;
  if (!result.agree) {
    const auto worst = std::max_element(
        result.suspicions.begin(), result.suspicions.end(),
        [](const Suspicion& a, const Suspicion& b) { return std::fabs(a.z) < std::fabs(b.z); });
    result.suspect = static_cast<int>(worst - result.suspicions.begin());
  }
  return result;
}

}  // namespace limn
