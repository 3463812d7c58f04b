// Errors of images against a reference, bias scores, slopes, ratios of time.
#include "limn/integrators/metrics.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace limn {
namespace {

// Of a block, over its sum: kept references are floats.
constexpr double kRounding = 0x1p-23;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// Squared error of a pixel over its channels, and the reference's share of it.
struct PixelError {
  double error = 0;
  double floor = 0;
};

std::vector<PixelError> pixel_errors(const std::vector<double>& image,
                                     const std::vector<double>& reference,
                                     const std::vector<double>& variance) {
  std::vector<PixelError> pixels(image.size() / 3);
  for (size_t i = 0; i < image.size(); ++i) {
    const double d = image[i] - reference[i];
    pixels[i / 3].error += d * d;
    pixels[i / 3].floor += variance[i];
  }
  return pixels;
}

double mean_without_floor(const std::vector<PixelError>& pixels, size_t count) {
  double sum = 0;
  for (size_t i = 0; i < count; ++i) sum += pixels[i].error - pixels[i].floor;
  return sum / (3.0 * static_cast<double>(count));
}

struct Variance {
  double value = 0;
  double degrees = 0;
};

// The variance of the mean over repeats of one block, to which edges add `edges`.
Variance variance_of_mean(const std::vector<BlockSums>& repeats, size_t block, double edges) {
  const auto count = static_cast<double>(repeats.size());
  std::vector<double> values;
  bool known = true;
  Variance own;
  double events = 0;
  for (const BlockSums& repeat : repeats) {
    values.push_back(repeat.sums[block]);
    events += edges * repeat.event / (count * count);
    known = known && !repeat.variances.empty();
    if (!known) continue;
    own.value += repeat.variances[block] / (count * count);
    own.degrees += repeat.degrees;
  }
  if (!known) {
    const double error = mean_of_repeats(values).error;
    if (std::isnan(error)) return {error, 0};
    own = {error * error, count - 1};
  }
  return {std::max(own.value, events), own.degrees};
}

double squared(double x) { return x * x; }

}  // namespace

size_t trimmed_pixels(size_t pixels) { return (pixels + 500) / 1000; }

ImageErrors image_errors(const std::vector<double>& image, const std::vector<double>& reference,
                         const std::vector<double>& reference_variance) {
  std::vector<PixelError> pixels = pixel_errors(image, reference, reference_variance);
  ImageErrors errors;
  errors.mse = mean_without_floor(pixels, pixels.size());
  const double power = mean_square(reference);
  errors.relative_mse = power > 0 ? errors.mse / power : kNaN;
  const size_t kept = pixels.size() - trimmed_pixels(pixels.size());
  std::nth_element(pixels.begin(), pixels.begin() + static_cast<std::ptrdiff_t>(kept), pixels.end(),
                   [](const PixelError& a, const PixelError& b) { return a.error < b.error; });
  errors.trimmed_mse = mean_without_floor(pixels, kept);
  return errors;
}

Uncertain mean_of_repeats(const std::vector<double>& values) {
  const double mean = mean_of(values);
  if (values.size() < 2) return {mean, kNaN};
  double squares = 0;
  for (const double v : values) squares += squared(v - mean);
  const auto n = static_cast<double>(values.size());
  return {mean, std::sqrt(squares / (n - 1) / n)};
}

std::vector<double> bias_scores(const std::vector<BlockSums>& repeats, const BlockSums& reference,
                                const std::vector<double>& edges) {
  std::vector<double> scores;
  for (size_t b = 0; b < reference.sums.size() && !repeats.empty(); ++b) {
    double mean = 0;
    for (const BlockSums& r : repeats) mean += r.sums[b] / static_cast<double>(repeats.size());
    const double residual = mean - reference.sums[b];
    const Variance ours = variance_of_mean(repeats, b, edges[b]);
    Variance theirs{reference.variances[b], reference.degrees};
    // No event of a reference has come here: it has missed what the method has, by so much.
    if (theirs.value == 0) theirs.value = std::fabs(mean) * reference.event;
    const double both = ours.value + theirs.value;
    if (std::isnan(both)) return {};
    const double rounding = kRounding * std::fabs(mean);
    if (both <= squared(rounding / 8) && std::fabs(residual) <= rounding) continue;
    const double degrees = std::min(ours.degrees, theirs.degrees);
    scores.push_back(
        normal_from_student(residual / std::sqrt(std::max(both, squared(rounding))), degrees));
  }
  return scores;
}

double p_value(const ZSummary& summary) {
  return std::min(1.0, 2 * std::min(summary.p_chi_square, summary.p_largest));
}

std::optional<Uncertain> log_log_slope(const std::vector<TimedError>& runs) {
  std::vector<double> x, y, relative;
  for (const TimedError& run : runs) {
    if (!(run.error.value > 0)) continue;
    x.push_back(std::log(run.seconds));
    y.push_back(std::log(run.error.value));
    relative.push_back(run.error.error / run.error.value);
  }
  if (x.size() < 2) return std::nullopt;
  const double center = mean_of(x);
  double spread = 0;
  for (const double v : x) spread += squared(v - center);
  if (spread == 0) return std::nullopt;
  Uncertain slope;
  double variance = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    const double weight = (x[i] - center) / spread;
    slope.value += weight * y[i];
    variance += squared(weight * relative[i]);
  }
  slope.error = std::sqrt(variance);
  return slope;
}

std::optional<Uncertain> time_ratio(const std::vector<double>& method,
                                    const std::vector<double>& baseline) {
  if (method.empty() || baseline.empty()) return std::nullopt;
  const Uncertain a = mean_of_repeats(method);
  const Uncertain b = mean_of_repeats(baseline);
  if (!(a.value > 0) || !(b.value > 0)) return std::nullopt;
  const double ratio = a.value / b.value;
  return Uncertain{ratio, ratio * std::hypot(a.error / a.value, b.error / b.value)};
}

}  // namespace limn
