#pragma once
// Two independent estimates of the same values, or one and an exact value.
#include <cmath>
#include <vector>

#include "limn/integrators/moments.h"
#include "limn/integrators/statistics.h"

namespace limn {

// z-scores of a - b_scale * b, value by value; values that are equal without variance are left out.
inline ZSummary compare_moments(const Moments& a, const Moments& b, double b_scale = 1) {
  std::vector<double> z;
  for (size_t i = 0; i < a.size(); ++i) {
    const double residual = a.mean(i) - b_scale * b.mean(i);
    const double variance = a.variance(i) + b_scale * b_scale * b.variance(i);
    if (residual == 0 && variance == 0) continue;
    z.push_back(normal_from_student(residual / std::sqrt(variance), a.degrees()));
  }
  return summarize(z);
}

inline ZSummary compare_moments(const Moments& a, const std::vector<double>& exact) {
  std::vector<double> z;
  for (size_t i = 0; i < a.size(); ++i) {
    const double residual = a.mean(i) - exact[i];
    if (residual == 0 && a.variance(i) == 0) continue;
    z.push_back(normal_from_student(residual / std::sqrt(a.variance(i)), a.degrees()));
  }
  return summarize(z);
}

}  // namespace limn
