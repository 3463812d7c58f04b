#pragma once
// Pearson's chi-square test and z-scores, for tests that judge samples by their own statistics.
#include <cmath>
#include <cstddef>
#include <vector>

namespace limn {

// Chance that a chi-square variable with k degrees of freedom exceeds x: Q(k/2, x/2), the upper
// regularised incomplete gamma function, by its series (small x) or its continued fraction
// (Abramowitz and Stegun 6.5.29 and 6.5.31).
inline double chi_square_tail(double x, double k) {
  const double a = 0.5 * k, y = 0.5 * x;
  if (y <= 0) return 1;
  const double front = std::exp(a * std::log(y) - y - std::lgamma(a));
  if (y < a + 1) {
    double term = 1 / a, sum = term;
    for (double n = a + 1; term > 1e-17 * sum; n += 1) sum += term *= y / n;
    return 1 - front * sum;
  }
  double fraction =
      0;  // evaluated from its tail: 400 levels are more than any y >= a + 1 needs here
  for (int n = 400; n > 0; --n) fraction = n * (a - n) / (y + 2 * n + 1 - a + fraction);
  return front / (y + 1 - a + fraction);
}

// Significance of the counts `observed` against the means `expected` (both of n cells, whose totals
// agree): the chance of a fit this bad or worse. Cells that expect less than 5 are pooled into one.
// An observation in a cell that expects none gives 0.
inline double chi_square_p_value(const std::vector<double>& observed,
                                 const std::vector<double>& expected) {
  double statistic = 0, pooled_observed = 0, pooled_expected = 0;
  int cells = 0;
  const auto add = [&](double o, double e) {
    statistic += (o - e) * (o - e) / e;
    ++cells;
  };
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] <= 0 && observed[i] > 0) return 0;
    if (expected[i] >= 5) {
      add(observed[i], expected[i]);
    } else {
      pooled_observed += observed[i];
      pooled_expected += expected[i];
    }
  }
  if (pooled_expected > 0) add(pooled_observed, pooled_expected);
  return cells > 1 ? chi_square_tail(statistic, cells - 1) : 1;
}

// Mean of independent samples, with the standard error of that mean.
class RunningMean {
 public:
  void add(double x) {
    ++count_;
    const double delta = x - mean_;
    mean_ += delta / count_;
    squares_ += delta * (x - mean_);
  }
  double mean() const { return mean_; }
  double standard_error() const { return std::sqrt(squares_ / (count_ * (count_ - 1))); }
  double z_score(double reference) const { return (mean_ - reference) / standard_error(); }

 private:
  double count_ = 0, mean_ = 0, squares_ = 0;
};

}  // namespace limn
