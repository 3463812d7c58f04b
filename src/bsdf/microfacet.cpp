// Sampling of visible microfacet normals.
#include "src/bsdf/microfacet.h"

#include <algorithm>

namespace limn::microfacet {
namespace {

const double kInverseSqrtPi = 1 / std::sqrt(kPi);

// u = 0 would give the slope minus infinity.
constexpr double kTiny = 0x1.0p-60;

// The x >= 0 with erfc(x) = q, 0 < q <= 1, by Winitzki's approximation (2008): 7e-3 off at most up
// to x = 5.4, beyond which erfc is below 1e-13.
double nearly_inverse_erfc(double q) {
  const double log_term = std::log(q * (2 - q));
  const double b = 2 / (kPi * 0.147) + 0.5 * log_term;
  return std::sqrt(std::max(0.0, std::sqrt(b * b - log_term / 0.147) - b));
}

// Better by four terms of the inverse's Taylor series around there: 5e-8 off at most up to
// x = 5.4, 1e-9 up to 4.8.
double inverse_erfc(double q) {
  const double x = nearly_inverse_erfc(q), x2 = x * x;
  const double d = (std::erfc(x) - q) / (2 * kInverseSqrtPi * std::exp(-x2));
  return x + d * (1 + d * (x + d * ((1 + 4 * x2) / 3 + d * x * (7 + 12 * x2) / 6)));
}

template <class Inverse>
double gaussian_slope_by(const Inverse& inverse, double u) {
  return u < 0.5 ? -inverse(2 * std::max(u, kTiny)) : inverse(2 * (1 - u));
}

}  // namespace

double gaussian_slope(double u) { return gaussian_slope_by(inverse_erfc, u); }

// The density is (c - x s)^+ exp(-x^2) up to a factor; its integral up to x,
//   F(x) = c erfc(-x) + s exp(-x^2) / sqrt(pi)   (times sqrt(pi) / 2),
// is inverted by Halley's method, safeguarded by a bracket.
// Heitz and d'Eon 2014, "Importance sampling microfacet-based BSDFs using the distribution of
// visible normals".
double beckmann_slope(double c, double s, double u) {
  double low = -7;  // beyond: 1e-21 of all slopes
  double high = c < 7 * s ? c / s : 7;
  const double target = u * (c * std::erfc(-high) + s * kInverseSqrtPi * std::exp(-high * high));
  double x = std::min(gaussian_slope_by(nearly_inverse_erfc, u),
                      0.5 * (low + high) + 0.5 * (high - low) * 0.999);
  for (int i = 0; i < 60; ++i) {
    const double gauss = kInverseSqrtPi * std::exp(-x * x), facing = c - x * s;
    const double error = c * std::erfc(-x) + s * gauss - target;
    (error > 0 ? high : low) = x;
    const double newton = error / (2 * gauss * facing);
    double next = x - newton / (1 + newton * (x + 0.5 * s / facing));
    // The next error is about the cube of this step.
    if (std::fabs(next - x) <= 1e-5) return next;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    x = next;
  }
  return x;
}

double beckmann_exact_g1_over_cos(double cos_v, double scaled_sin) {
  // erfc(6) and exp(-36) vanish beside 1 in double precision.
  if (cos_v > 6 * scaled_sin) return 1 / cos_v;
  const double a = cos_v / scaled_sin;
  return 2 / (cos_v * (1 + std::erf(a)) + scaled_sin * kInverseSqrtPi * std::exp(-a * a));
}

Vec3d beckmann_visible(const Vec3d& v, double alpha_x, double alpha_y, double u1, double u2) {
  const Vec3d stretched = normalize(Vec3d{alpha_x * v.x, alpha_y * v.y, v.z});
  const double sin_v = std::hypot(stretched.x, stretched.y);
  const double cos_phi = sin_v > 0 ? stretched.x / sin_v : 1;
  const double sin_phi = sin_v > 0 ? stretched.y / sin_v : 0;
  const double along = beckmann_slope(stretched.z, sin_v, u1);
  const double across = gaussian_slope(u2);
  const double slope_x = alpha_x * (cos_phi * along - sin_phi * across);
  const double slope_y = alpha_y * (sin_phi * along + cos_phi * across);
  return {-slope_x, -slope_y, 1};
}

}  // namespace limn::microfacet
