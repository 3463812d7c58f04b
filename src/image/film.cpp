// Reconstruction filters and the part of the film that a pixel sees.
#include "limn/core/film.h"

#include <algorithm>
#include <cmath>

#include "limn/core/check.h"
#include "limn/core/vec.h"

namespace limn {

namespace {

// The gaussian is lowered by its value at the radius, so that it ends continuously.
double gaussian_floor(const Filter& f) {
  return std::exp(-f.radius * f.radius / (2 * f.stddev * f.stddev));
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
    // Triangles of the two halves; the right half by symmetry.
    const double to_end = radius - std::fabs(x);
    const double tail = to_end * to_end / (2 * radius);
    return x <= 0 ? tail : radius - tail;
  }
  const double scale = stddev * std::sqrt(kPi / 2);
  const double inverse = 1 / (stddev * std::sqrt(2.0));
  return scale * (std::erf(x * inverse) + std::erf(radius * inverse)) -
         gaussian_floor(*this) * (x + radius);
}

// Inversion of the integral by Newton's method, kept inside a shrinking bracket: exact to rounding
// for every filter, and one random number per sample.
double Filter::sample(double lower, double upper, Rng& rng) const {
  DCHECK_LT(integral(lower), integral(upper));
  const double u = rng.uniform();
  if (kind == Kind::kBox) return lower + u * (upper - lower);
  const double target = integral(lower) + u * (integral(upper) - integral(lower));
  double a = lower, b = upper;
  double x = std::clamp(0.0, lower, upper);
  for (int i = 0; i < 200; ++i) {
    const double excess = integral(x) - target;
    const double slope = eval(x);
    const double newton = x - excess / slope;
    // Newton's error squares with each step: after a step this small it is below rounding.
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

namespace {

Film::Range range_around(double center, double begin, double end, bool unbounded, double radius) {
  if (unbounded) return {-radius, radius};
  return {std::max(-radius, begin - center), std::min(radius, end - center)};
}

}  // namespace

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
