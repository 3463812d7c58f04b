// Reconstruction filters and their support on the film.
#include "limn/core/film.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/memory.h"
#include "limn/core/vec.h"

namespace limn {

namespace {

// The least density of a bin, relative to the filter's peak: bins around its zeros need some.
constexpr double kLeastDensity = 1e-3;

// The gaussian minus its value at the radius, so that it ends continuously.
double gaussian_floor(const Filter& f) {
  return std::exp(-f.radius * f.radius / (2 * f.stddev * f.stddev));
}

// Mitchell and Netravali's polynomials in |x| / 6, from the constant term on.
using Cubic = std::array<double, 4>;
Cubic cubic(const Filter& f, bool inner) {
  if (inner) return {6 - 2 * f.b, 0, -18 + 12 * f.b + 6 * f.c, 12 - 9 * f.b - 6 * f.c};
  return {8 * f.b + 24 * f.c, -12 * f.b - 48 * f.c, 6 * f.b + 30 * f.c, -f.b - 6 * f.c};
}
double antiderivative(const Cubic& p, double x) {
  return x * (p[0] + x * (p[1] / 2 + x * (p[2] / 3 + x * p[3] / 4))) / 6;
}

double sinc(double x) { return std::fabs(x) < 1e-5 ? 1 - x * x / 6 : std::sin(x) / x; }
double sinc_slope(double x) {
  return std::fabs(x) < 1e-3 ? -x / 3 : (std::cos(x) - std::sin(x) / x) / x;
}

// Integral from 0 to x in [0, radius].
double right_part(const Filter& f, double x) {
  if (f.kind == Filter::Kind::kCubic) {
    const double inner = antiderivative(cubic(f, true), std::min(x, 1.0));
    const Cubic outer = cubic(f, false);
    return x <= 1 ? inner : inner + antiderivative(outer, x) - antiderivative(outer, 1);
  }
  // Gauss and Legendre's rule on parts of half a pixel, of which a wave of the sinc has four.
  constexpr double kNodes[4] = {.1834346424956498, .5255324099163290, .7966664774136267,
                                .9602898564975363};
  constexpr double kWeights[4] = {.3626837833783620, .3137066458778873, .2223810344533745,
                                  .1012285362903763};
  const int parts = static_cast<int>(std::ceil(2 * x));
  double sum = 0;
  for (int i = 0; i < parts; ++i) {
    const double half = 0.5 * x / parts, middle = (2 * i + 1) * half;
    for (int k = 0; k < 4; ++k) {
      sum += half * kWeights[k] *
             (f.eval(middle - half * kNodes[k]) + f.eval(middle + half * kNodes[k]));
    }
  }
  return sum;
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
  if (kind == Kind::kLanczos) return sinc(kPi * x) * sinc(kPi * x / radius);
  if (kind == Kind::kCubic) {
    const Cubic p = cubic(*this, std::fabs(x) < 1);
    return (p[0] + std::fabs(x) * (p[1] + std::fabs(x) * (p[2] + std::fabs(x) * p[3]))) / 6;
  }
  return std::exp(-x * x / (2 * stddev * stddev)) - gaussian_floor(*this);
}

double Filter::slope(double x) const {
  if (kind == Kind::kBox || x == 0 || std::fabs(x) >= radius) return 0;
  if (kind == Kind::kTent) return std::copysign(1 / radius, -x);
  if (kind == Kind::kLanczos) {
    const double wave = kPi * x, window = wave / radius;
    return kPi * (sinc_slope(wave) * sinc(window) + sinc(wave) * sinc_slope(window) / radius);
  }
  if (kind == Kind::kCubic) {
    const Cubic p = cubic(*this, std::fabs(x) < 1);
    const double at = std::fabs(x);
    return std::copysign(1, x) * (p[1] + at * (2 * p[2] + at * 3 * p[3])) / 6;
  }
  const double variance = stddev * stddev;
  return -x / variance * std::exp(-x * x / (2 * variance));
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
  if (is_signed()) {
    const double all = kind == Kind::kLanczos ? half : right_part(*this, radius);
    const double part = std::fabs(x) < radius ? right_part(*this, std::fabs(x)) : all;
    return all + std::copysign(part, x);
  }
  const double scale = stddev * std::sqrt(kPi / 2);
  const double inverse = 1 / (stddev * std::sqrt(2.0));
  return scale * (std::erf(x * inverse) + std::erf(radius * inverse)) -
         gaussian_floor(*this) * (x + radius);
}

Filter cubic_filter(double b, double c) { return {Filter::Kind::kCubic, 2, 0, b, c, 0}; }

Filter lanczos_filter(int lobes) {
  Filter filter{Filter::Kind::kLanczos, static_cast<double>(lobes), 0};
  filter.half = right_part(filter, filter.radius);
  return filter;
}

// Inverts the integral by Newton's method, safeguarded by a shrinking bracket: exact to rounding
// for every filter.
double Filter::quantile(double lower, double upper, double u) const {
  DCHECK_LT(integral(lower), integral(upper));
  if (kind == Kind::kBox) return lower + u * (upper - lower);
  const double target = integral(lower) + u * (integral(upper) - integral(lower));
  double begin = lower, end = upper;
  double x = std::clamp(0.0, lower, upper);
  for (int i = 0; i < 200; ++i) {
    const double excess = integral(x) - target;
    const double derivative = eval(x);
    const double newton = x - excess / derivative;
    // Convergence is quadratic: after so small a step the error is below rounding.
    if (derivative > 0 && std::fabs(newton - x) <= 0x1p-30 * radius) {
      return std::clamp(newton, lower, upper);
    }
    (excess > 0 ? end : begin) = x;
    const double next =
        derivative > 0 && newton > begin && newton < end ? newton : 0.5 * (begin + end);
    if (next == begin || next == end) break;
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
  if (filter.is_signed()) {
    const auto bins = static_cast<int>(std::ceil(2 * filter.radius)) * kBins;
    const double width = 2 * filter.radius / bins;
    upto_.push_back(0);
    for (int i = 0; i < bins; ++i) {
      const auto at = [&](double part) {
        return std::fabs(filter.eval(-filter.radius + (i + part) * width));
      };
      upto_.push_back(upto_.back() + width * std::max({at(0), at(0.5), at(1), kLeastDensity}));
    }
    return;
  }
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

double FilterTable::mass(double x) const {
  const auto bins = static_cast<double>(upto_.size() - 1);
  const double at = std::clamp((x / filter_.radius + 1) * 0.5 * bins, 0.0, bins);
  const auto i = std::min(static_cast<size_t>(at), upto_.size() - 2);
  return upto_[i] + (upto_[i + 1] - upto_[i]) * (at - static_cast<double>(i));
}

double FilterTable::pdf(double lower, double upper, double x) const {
  if (upto_.empty()) return filter_.eval(x) / (integral(upper) - integral(lower));
  const auto bins = static_cast<double>(upto_.size() - 1);
  const double at = std::clamp((x / filter_.radius + 1) * 0.5 * bins, 0.0, bins - 1);
  const auto i = static_cast<size_t>(at);
  return (upto_[i + 1] - upto_[i]) * bins / (2 * filter_.radius) / (mass(upper) - mass(lower));
}

double FilterTable::weight(double lower, double upper, double x) const {
  if (upto_.empty()) return 1;
  return filter_.eval(x) / ((integral(upper) - integral(lower)) * pdf(lower, upper, x));
}

double FilterTable::quantile(double lower, double upper, double u) const {
  if (!upto_.empty()) {
    const double first = mass(lower), sought = first + u * (mass(upper) - first);
    const auto next = std::upper_bound(upto_.begin() + 1, upto_.end() - 1, sought);
    const double part = (sought - next[-1]) / (next[0] - next[-1]);
    const auto bins = static_cast<double>(upto_.size() - 1);
    const double at = static_cast<double>(next - upto_.begin()) - 1 + part;
    return std::clamp((2 * at / bins - 1) * filter_.radius, lower, upper);
  }
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

void check_film_size(const SourceLocation& where, int width, int height,
                     const std::string& remedy) {
  // Memory of an image, measured on films of 1, 4 and 16 million pixels; derivatives take more.
  constexpr double kBytesPerPixel = 76;
  const int64_t pixels = int64_t{width} * height;
  const std::string size = fmt::format("the film of {} x {} pixels", width, height);
  if (pixels > kMaxPixels) {
    throw InputError(
        where, fmt::format("{} is too large (at most {} pixels): {}", size, kMaxPixels, remedy));
  }
  require_memory(where, kBytesPerPixel * static_cast<double>(pixels), size, remedy);
}

Image to_image(const std::vector<double>& values, const Film& film) {
  Image image(film.crop_width, film.crop_height, 3);
  CHECK_EQ(values.size(), image.data.size());
  for (size_t i = 0; i < values.size(); ++i) image.data[i] = static_cast<float>(values[i]);
  return image;
}

}  // namespace limn
