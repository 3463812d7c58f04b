#pragma once
// Pearson's chi-square test for samplers.
#include <vector>

namespace limn::test {

// Q(a, x) = Gamma(a, x) / Gamma(a), the upper regularised incomplete gamma function; a > 0, x >= 0.
double upper_gamma(double a, double x);

struct ChiSquare {
  double statistic = 0;
  int degrees_of_freedom = 0;
  double p_value = 1;
};

// observed, expected: counts per bin, over bins that cover everything (failed draws are a bin too).
// Bins that expect fewer than ten are pooled. A count where none is possible gives p = 0.
ChiSquare chi_square_test(const std::vector<double>& observed, const std::vector<double>& expected);

// The p-value that one of `tests` independent tests must fall below for the whole family to be
// rejected at `significance` (Sidak).
double sidak_threshold(double significance, int tests);

}  // namespace limn::test
