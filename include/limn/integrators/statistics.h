#pragma once
// Deciding whether estimates agree.
#include <vector>

namespace limn {

// Two-sided p-value of a standard normal z.
double normal_p_value(double z);

// A Student t value with `degrees` of freedom as a standard normal z of the same tail (Wallace
// 1959).
double normal_from_student(double t, double degrees);

// p-value of a chi-square statistic (upper tail; Wilson and Hilferty 1931, good from about ten
// degrees of freedom on).
double chi_square_p_value(double statistic, double degrees);

// A set of z-scores that should be standard normal.
struct ZSummary {
  int count = 0;
  double mean = 0;
  double deviation = 0;
  double largest = 0;       // |z|
  double p_chi_square = 1;  // of the sum of squares
  double p_largest = 1;     // of the largest, for this many of them
  // No test finds a disagreement at this level.
  bool plausible(double level) const { return p_chi_square >= level && p_largest >= level; }
};
ZSummary summarize(const std::vector<double>& z);

double mean_of(const std::vector<double>& values);
double mean_square(const std::vector<double>& values);

}  // namespace limn
