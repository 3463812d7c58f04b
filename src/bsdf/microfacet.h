#pragma once
// Microfacet distributions in terms of cosines and squared sines, over double or Dual; GGX and
// Fresnel's formula also over wide::Doubles.
//
// h is the half vector of wi (towards the viewer) and wo, alpha the roughness; v stands for either
// direction, cos_v = n.v. D: density of facet normals; G1: Smith masking of one direction. Masking
// and shadowing are taken as independent: G = G1(wi) G1(wo).
// Walter et al. 2007, "Microfacet models for refraction through rough surfaces".
#include "limn/core/dual.h"
#include "limn/core/vec.h"
#include "src/base/angles.h"
#include "src/base/wide.h"

namespace limn::microfacet {

using std::exp;
using std::sqrt;

// t < 0 ? a : b.
template <class S>
[[gnu::always_inline]] inline S below_zero(const S& t, const S& a, const S& b) {
  if constexpr (std::is_same_v<S, wide::Doubles>) {
    return select(t < 0, a, b);
  } else {
    return value(t) < 0 ? a : b;
  }
}

// GGX: D = alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2), cos and sin of the angle between n and h. Both
// squares f times as large give D / f^2, here and below.
template <class S>
S ggx_d(const S& cos2, const S& sin2, const S& alpha) {
  const S a2 = alpha * alpha;
  const S q = a2 * cos2 + sin2;
  return a2 / (q * q * kPi);
}

// Beckmann: D = exp(-tan^2 / alpha^2) / (pi alpha^2 cos^4).
template <class S>
S beckmann_d(const S& cos2, const S& sin2, const S& alpha) {
  const S scaled_cos2 = alpha * alpha * cos2;
  // Beyond this, exp() is below 1e-304 and its factors may overflow.
  if (!(value(sin2) < 700 * value(scaled_cos2))) return 0.0;
  return exp(-(sin2 / scaled_cos2)) / (scaled_cos2 * cos2 * kPi);
}

// G1(v) / cos_v, which stays finite as cos_v goes to 0.
// GGX: G1 = 2 / (1 + sqrt(1 + alpha^2 tan^2)).
template <class S>
S ggx_g1_over_cos(const S& cos_v, const S& alpha) {
  const S a2 = alpha * alpha;
  return 2.0 / (cos_v + sqrt(a2 + cos_v * cos_v * (1.0 - a2)));
}

// Beckmann, Walter's rational approximation (27) in a = 1 / (alpha tan): at most 0.35 % off, and
// what Mitsuba evaluates. The rational passes 1 at a = 1.548; from there on G1 is 1 (Walter and
// Mitsuba go on to a = 1.6 and are discontinuous there, by 6e-5).
template <class S>
S beckmann_g1_over_cos(const S& cos_v, const S& alpha) {
  constexpr double kOne = 1.5481331257;  // root of 3.535 a + 2.181 a^2 = 1 + 2.276 a + 2.577 a^2
  const S sin2 = 1.0 - cos_v * cos_v;
  const double limit = kOne * kOne * value(alpha) * value(alpha) * value(sin2);
  if (value(cos_v) * value(cos_v) >= limit) return 1.0 / cos_v;
  const S cot_scale = 1.0 / (alpha * sqrt(sin2));
  const S a = cos_v * cot_scale;
  return cot_scale * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a));
}

// Both with alpha^2 sin^2 in place of alpha, for roughness that depends on the direction.
template <class S>
S ggx_g1_over_cos_scaled(const S& cos_v, const S& scaled_sin2) {
  return 2.0 / (cos_v + sqrt(cos_v * cos_v + scaled_sin2));
}
template <class S>
S beckmann_g1_over_cos_scaled(const S& cos_v, const S& scaled_sin2) {
  const S cos2 = cos_v * cos_v, sum = cos2 + scaled_sin2;
  // The roughness 1 at the angle whose tangent is as large.
  const S length = sqrt(sum);
  return beckmann_g1_over_cos(S(cos_v / length), S(1.0)) / length;
}

// The exact G1(v) / cos_v = 2 / (cos (1 + erf a) + alpha sin exp(-a^2) / sqrt(pi)): the
// normalisation of the density of visible normals. scaled_sin: alpha sin.
double beckmann_exact_g1_over_cos(double cos_v, double scaled_sin);

// The largest ratio of the rational to the exact G1.
inline constexpr double kBeckmannRationalExcess = 1.0035;

// Quantile of the density exp(-x^2) / sqrt(pi).
double gaussian_slope(double u);
// A slope, towards v, of the visible facets of a Beckmann surface of roughness 1, from a number in
// [0, 1); c, s: cosine and sine of v.
double beckmann_slope(double c, double s, double u);

// Normals h visible from v (in the frame where n is +z, v.z > 0), with density
// D(h) G1(v) max(0, v.h) / v.z per solid angle of h, from two numbers in [0, 1). Of any length. The
// roughness is alpha_x along x, alpha_y along y.
Vec3d beckmann_visible(const Vec3d& v, double alpha_x, double alpha_y, double u1, double u2);

// The visible normals of the stretched surface (roughness 1: a hemisphere) are half vectors of v
// and directions uniform on the cap of the sphere around it. Dupuy and Benyoub 2023, "Sampling
// visible GGX normals with spherical caps".
template <class S>
Vec3<S> ggx_visible(const Vec3<S>& v, double alpha_x, double alpha_y, const S& u1, const S& u2) {
  const Vec3<S> longer{alpha_x * v.x, alpha_y * v.y, v.z};
  const Vec3<S> stretched = longer * (1.0 / length(longer));
  const SinCosOf<S> phi = sin_cos_of_turns(u1);
  const S z = (1.0 - u2) * (1.0 + stretched.z) - stretched.z;
  const S r2 = 1.0 - z * z;
  const S r = sqrt(below_zero(r2, S(0.0), r2));
  return {alpha_x * (stretched.x + r * phi.cos), alpha_y * (stretched.y + r * phi.sin),
          stretched.z + z};
}

// Reflectance of a conductor for unpolarised light; refractive index eta + i k, relative to the
// outside; cos of the angle of incidence. With t = eta^2 - k^2 - sin^2, s = |(t, 2 eta k)| + |t|
// and r = sqrt(2 s), the refracted wave has a = (t < 0 ? 2 eta k / r : r / 2), without
// cancellation; what follows is extended by r, and has one division.
template <class S, class E>
S fresnel_conductor(const S& cos_h, const E& eta, const E& k) {
  constexpr double kTiny = 1e-100;  // s is 0 at the critical angle if k = 0
  const S c2 = cos_h * cos_h;
  const S s2 = 1.0 - c2;
  const E nk = eta * k;
  const S t = eta * eta - k * k - s2;
  const S a2b2 = sqrt(t * t + 4 * nk * nk);
  const S s = a2b2 + below_zero(t, S(-t), t) + kTiny;
  const S r = sqrt(2.0 * s);
  const S two_ac = cos_h * below_zero(t, S(4 * nk), S(2.0 * s));
  const S m = (a2b2 + c2) * r, p = (a2b2 * c2 + s2 * s2) * r;
  return (m - two_ac) * p / ((m + two_ac) * (p + two_ac * s2));
}

}  // namespace limn::microfacet
