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
// With steps that shrink as n^-1/5 the variance of edges in differences goes with n^-4/5.
constexpr double kVariancePower = 1.25;

}  // namespace

// With variances a / n and b / m and costs n s + m t, the least cost for the sum of variances has
// n and m in proportion to sqrt(a / s) and sqrt(b / t).
std::optional<CheckSamples> more_samples(const CheckCost& gradient, const CheckCost& differences,
                                         double factor, double seconds) {
  const CheckCost* const runs[2] = {&gradient, &differences};
  double shares[2], sum = 0, before = 0;
  for (int i = 0; i < 2; ++i) {
    const auto n = static_cast<double>(runs[i]->samples);
    const double cost = std::max(runs[i]->seconds, 1e-9) / n;
    const double variance = runs[i]->variance * n;
    shares[i] = std::sqrt(variance / cost);
    sum += std::sqrt(variance * cost);
    before += runs[i]->seconds;
  }
  const double most = std::min(seconds, kMostGrowth * before);
  if (most <= before || !(sum > 0)) return std::nullopt;
  const double wanted =
      (gradient.variance + differences.variance) * std::pow(kMargin * factor, 2 * kVariancePower);
  const double scale = std::min(sum / wanted, most / sum);
  const auto samples = [&](double share) {
    return static_cast<int64_t>(
        std::clamp(scale * share, double{kFirstCheckSamples}, double{1 << 30}));
  };
  return CheckSamples{samples(shares[0]), samples(shares[1])};
}

}  // namespace limn
