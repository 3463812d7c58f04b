// Reconstruction filters and their support on the film.
#include "limn/core/film.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/vec.h"

namespace limn {

namespace {

// The gaussian minus its value at the radius, so that it ends continuously.
double gaussian_floor(const Filter& f) {
  return std::exp(-f.radius * f.radius / (2 * f.stddev * f.stddev));
}

Film::Range range_around(double center, double begin, double end, bool unbounded, double radius) {
  if (unbounded) return {-radius, radius};
  return {std::max(-radius, begin - center), std::min(radius, end - center)};
}

}  // namespace

double Filter::eval(double x) const {
  if (kind == Kind::kBox) return x >= -radius && x < radius ? 1 : 0;
  if (std::fabs(x) >= radius) return 0;
  if (kind == Kind::kTent) return 1 - std::fabs(x) / radius;
  return std::exp(-x * x / (2 * stddev * stddev)) - gaussian_floor(*this);
}

double Filter::integral(double x) const {
  x = std::clamp(x, -radius, radius);
  if (kind == Kind::kBox) return x + radius;
  if (kind == Kind::kTent) {
    // Integral over the triangle's left half; the right half by symmetry.
    const double to_end = radius - std::fabs(x);
    const double tail = to_end * to_end / (2 * radius);
    return x <= 0 ? tail : radius - tail;
  }
  const double scale = stddev * std::sqrt(kPi / 2);
  const double inverse = 1 / (stddev * std::sqrt(2.0));
  return scale * (std::erf(x * inverse) + std::erf(radius * inverse)) -
         gaussian_floor(*this) * (x + radius);
}

// Inverts the integral by Newton's method, safeguarded by a shrinking bracket: exact to rounding
// for every filter.
double Filter::quantile(double lower, double upper, double u) const {
  DCHECK_LT(integral(lower), integral(upper));
  if (kind == Kind::kBox) return lower + u * (upper - lower);
  const double target = integral(lower) + u * (integral(upper) - integral(lower));
  double a = lower, b = upper;
  double x = std::clamp(0.0, lower, upper);
  for (int i = 0; i < 200; ++i) {
    const double excess = integral(x) - target;
    const double slope = eval(x);
    const double newton = x - excess / slope;
    // Convergence is quadratic: after so small a step the error is below rounding.
    if (slope > 0 && std::fabs(newton - x) <= 0x1p-30 * radius) {
      return std::clamp(newton, lower, upper);
    }
    (excess > 0 ? b : a) = x;
    const double next = slope > 0 && newton > a && newton < b ? newton : 0.5 * (a + b);
    if (next == a || next == b) break;
    x = next;
  }
  return x;
}

// Chebyshev nodes on [0, 1].
const FilterTable::Piece& FilterTable::nodes() {
  static const Piece kAll = [] {
    Piece all;
    for (int i = 0; i < kNodes; ++i) all[i] = 0.5 - 0.5 * std::cos(kPi * (i + 0.5) / kNodes);
    return all;
  }();
  return kAll;
}

FilterTable::FilterTable(const Filter& filter)
    : filter_(filter), total_(filter.integral(filter.radius)) {
  if (filter.kind == Filter::Kind::kBox) return;
  const Piece& t = nodes();
  constexpr int kPieces = 1 << kPieceBits;
  for (int k = 0; k < kPowers * kPieces; ++k) {
    const double power = std::ldexp(1.0, k / kPieces - kPowers);
    Piece c;
    for (int i = 0; i < kNodes; ++i) {
      const double part = power * (1 + (k % kPieces + t[i]) / kPieces);  // of the left half
      c[i] = filter.quantile(-filter.radius, filter.radius, 0.5 * part);
    }
    for (int order = 1; order < kNodes; ++order) {
      for (int i = kNodes - 1; i >= order; --i) c[i] = (c[i] - c[i - 1]) / (t[i] - t[i - order]);
    }
    pieces_.push_back(c);
  }
}

double FilterTable::integral(double x) const {
  return x <= -filter_.radius ? 0 : x >= filter_.radius ? total_ : filter_.integral(x);
}

double FilterTable::quantile(double lower, double upper, double u) const {
  if (pieces_.empty()) return lower + u * (upper - lower);
  const double start = integral(lower);
  const double below = start + u * (integral(upper) - start);
  const bool left = below < total_ - below;
  const double part = std::min(2 * (left ? below : total_ - below) / total_, 1 - 0x1p-53);
  // The piece is given by the exponent and the leading bits of the mantissa.
  constexpr int kRest = 52 - kPieceBits;
  const auto bits = std::bit_cast<uint64_t>(part);
  constexpr uint64_t kFirst = uint64_t{1023 - kPowers} << kPieceBits;
  if (!(part >= 0) || bits >> kRest < kFirst) return filter_.quantile(lower, upper, u);
  const Piece& c = pieces_[(bits >> kRest) - kFirst];
  const double t =
      static_cast<double>(bits & ((uint64_t{1} << kRest) - 1)) * (1.0 / (uint64_t{1} << kRest));
  const Piece& at = nodes();
  double x = c[kNodes - 1];
  for (int i = kNodes - 2; i >= 0; --i) x = c[i] + (t - at[i]) * x;
  return std::clamp(left ? x : -x, lower, upper);
}

Film::Range Film::range_x(int pixel) const {
  return range_around(pixel + 0.5, crop_x, crop_x + crop_width, sample_border, filter.radius);
}

Film::Range Film::range_y(int pixel) const {
  return range_around(pixel + 0.5, crop_y, crop_y + crop_height, sample_border, filter.radius);
}

Image to_image(const std::vector<double>& values, const Film& film) {
  Image image(film.crop_width, film.crop_height, 3);
  CHECK_EQ(values.size(), image.data.size());
  for (size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]);
  return image;
}

}  // namespace limn
