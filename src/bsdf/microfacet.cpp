// Sampling of visible microfacet normals.
#include "src/bsdf/microfacet.h"

#include <algorithm>

namespace limn::microfacet {
namespace {

const double kInverseSqrtPi = 1 / std::sqrt(kPi);

// The x >= 0 with erfc(x) = q, 0 < q <= 1: Winitzki's approximation (2008, 4e-3 off), then two
// steps of Halley's method, each of which cubes the error.
double inverse_erfc(double q) {
  const double log_term = std::log(q * (2 - q));
  const double b = 2 / (kPi * 0.147) + 0.5 * log_term;
  double x = std::sqrt(std::max(0.0, std::sqrt(b * b - log_term / 0.147) - b));
  for (int i = 0; i < 2; ++i) {
    const double newton = (std::erfc(x) - q) / (2 * kInverseSqrtPi * std::exp(-x * x));
    x += newton / (1 + x * newton);
  }
  return x;
}

}  // namespace

double gaussian_slope(double u) {
  constexpr double kTiny = 0x1.0p-60;  // u = 0 would be minus infinity
  return u < 0.5 ? -inverse_erfc(2 * std::max(u, kTiny)) : inverse_erfc(2 * (1 - u));
}

// The density is (c - x s)^+ exp(-x^2) up to a factor; its integral up to x,
//   F(x) = c erfc(-x) + s exp(-x^2) / sqrt(pi)   (times sqrt(pi) / 2),
// is inverted by Newton's method, safeguarded by a bracket.
// Heitz and d'Eon 2014, "Importance sampling microfacet-based BSDFs using the distribution of
// visible normals".
double beckmann_slope(double c, double s, double u) {
  const auto integral = [=](double x) {
    return c * std::erfc(-x) + s * kInverseSqrtPi * std::exp(-x * x);
  };
  double low = -7;  // beyond: 1e-21 of all slopes
  double high = c < 7 * s ? c / s : 7;
  const double target = u * integral(high);
  double x = std::min(gaussian_slope(u), 0.5 * (low + high) + 0.5 * (high - low) * 0.999);
  for (int i = 0; i < 60; ++i) {
    const double error = integral(x) - target;
    (error > 0 ? high : low) = x;
    const double slope = 2 * kInverseSqrtPi * std::exp(-x * x) * (c - x * s);
    double next = x - error / slope;
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    // Newton's next error is about the square of this step.
    if (std::fabs(next - x) <= 1e-8) return next;
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
