// Scores and their chances.
#include "limn/integrators/statistics.h"

#include <algorithm>
#include <cmath>

namespace limn {

double normal_p_value(double z) { return std::erfc(std::fabs(z) / std::sqrt(2.0)); }

double normal_from_student(double t, double degrees) {
  const double z =
      std::sqrt(degrees * std::log1p(t * t / degrees)) * (8 * degrees + 1) / (8 * degrees + 3);
  return std::copysign(z, t);
}

double chi_square_p_value(double statistic, double degrees) {
  const double spread = 2 / (9 * degrees);
  const double z = (std::cbrt(statistic / degrees) - (1 - spread)) / std::sqrt(spread);
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

ZSummary summarize(const std::vector<double>& z) {
  ZSummary summary;
  summary.count = static_cast<int>(z.size());
  if (z.empty()) return summary;
  double squares = 0;
  for (const double value : z) {
    summary.mean += value / z.size();
    squares += value * value;
    // A NaN must not pass for a small score.
    if (!(std::fabs(value) <= summary.largest)) summary.largest = std::fabs(value);
  }
  summary.deviation = std::sqrt(std::max(0.0, squares / z.size() - summary.mean * summary.mean));
  summary.p_chi_square = chi_square_p_value(squares, static_cast<double>(z.size()));
  summary.p_largest = -std::expm1(z.size() * std::log1p(-normal_p_value(summary.largest)));
  return summary;
}

double mean_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum / static_cast<double>(values.size());
}

double mean_square(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return sum / static_cast<double>(values.size());
}

}  // namespace limn
