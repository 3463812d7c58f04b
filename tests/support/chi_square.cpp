// Pearson's test: bins with few expected samples are pooled.
#include "support/chi_square.h"

#include <cmath>
#include <cstddef>

namespace limn::test {
namespace {

// P(a, x) = x^a exp(-x) / Gamma(a + 1) * (1 + x / (a + 1) + x^2 / ((a + 1)(a + 2)) + ...).
double lower_gamma_series(double a, double x) {
  double term = 1, sum = 1;
  for (int n = 1; n < 10000 && term > 1e-17 * sum; ++n) {
    term *= x / (a + n);
    sum += term;
  }
  return sum * std::exp(a * std::log(x) - x - std::lgamma(a + 1));
}

// Gamma(a, x) = exp(-x) x^a * 1/(x + 1 - a - 1(1 - a)/(x + 3 - a - 2(2 - a)/(x + 5 - a - ...))),
// evaluated from the far end.
double upper_gamma_fraction(double a, double x) {
  const int depth = 2000;
  double tail = 0;
  for (int n = depth; n >= 1; --n) tail = n * (n - a) / (x + 2 * n + 1 - a - tail);
  return std::exp(a * std::log(x) - x - std::lgamma(a)) / (x + 1 - a - tail);
}

}  // namespace

double upper_gamma(double a, double x) {
  if (x <= 0) return 1;
  return x < a + 1 ? 1 - lower_gamma_series(a, x) : upper_gamma_fraction(a, x);
}

ChiSquare chi_square_test(const std::vector<double>& observed,
                          const std::vector<double>& expected) {
  ChiSquare result;
  double pooled_observed = 0, pooled_expected = 0;
  int bins = 0;
  const auto add = [&](double seen, double wanted) {
    result.statistic += (seen - wanted) * (seen - wanted) / wanted;
    ++bins;
  };
  for (size_t i = 0; i < observed.size(); ++i) {
    if (expected[i] <= 0 && observed[i] > 0) {
      result.p_value = 0;
      return result;
    }
    if (expected[i] >= 10) {
      add(observed[i], expected[i]);
    } else {
      pooled_observed += observed[i];
      pooled_expected += expected[i];
    }
  }
  // A pool too small for the normal approximation counts when it holds far too much.
  if (pooled_expected >= 10 || pooled_observed >= 10 + 10 * pooled_expected) {
    add(pooled_observed, pooled_expected);
  }
  result.degrees_of_freedom = bins - 1;
  if (bins > 1) result.p_value = upper_gamma(0.5 * (bins - 1), 0.5 * result.statistic);
  return result;
}

double sidak_threshold(double significance, int tests) {
  return -std::expm1(std::log1p(-significance) / tests);
}

}  // namespace limn::test
