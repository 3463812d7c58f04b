// Samples of a gradient and of its differences for the least time.
#include "integrators/compare/check_samples.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// A short run does not know its variances well: the next one takes so many times its time at most.
// Not tuned.
constexpr double kMostGrowth = 16;
// The error aimed at, over the one requested: variances are known to some ten per cent. Not tuned.
constexpr double kMargin = 0.85;
constexpr double kLeastShare = 0.125;  // of the time. Not tuned.
// With steps that shrink as n^-1/5 the variance of edges in differences goes with n^-4/5.
constexpr double kVariancePower = 1.25;

}  // namespace

// With variances a / n and b / m and costs n s + m t, the least cost for the sum of variances has
// n and m in proportion to sqrt(a / s) and sqrt(b / t).
std::optional<CheckSamples> more_samples(const CheckCost& gradient, const CheckCost& differences,
                                         double factor, double seconds) {
  const CheckCost* const runs[2] = {&gradient, &differences};
  double cost[2], spent[2], sum = 0, before = 0;
  for (int i = 0; i < 2; ++i) {
    const auto n = static_cast<double>(runs[i]->samples);
    cost[i] = std::max(runs[i]->seconds, 1e-9) / n;
    spent[i] = std::sqrt(runs[i]->variance * n * cost[i]);
    sum += spent[i];
    before += runs[i]->seconds;
  }
  const double most = std::min(seconds, kMostGrowth * before);
  if (most <= before || !(sum > 0)) return std::nullopt;
  for (double& part : spent) part = std::max(part, kLeastShare * sum);
  const double wanted =
      (gradient.variance + differences.variance) * std::pow(kMargin * factor, 2 * kVariancePower);
  const double scale = std::min(sum / wanted, most / (spent[0] + spent[1]));
  const auto samples = [&](int i) {
    return static_cast<int64_t>(std::clamp(scale * spent[i] / cost[i], double{kFirstCheckSamples},
                                           double{kMostCheckSamples}));
  };
  return CheckSamples{samples(0), samples(1)};
}

}  // namespace limn
