#pragma once
// Microfacet distributions in terms of cosines and squared sines, over double or Dual.
//
// h is the half vector of wi (towards the viewer) and wo, alpha the roughness; v stands for either
// direction, cos_v = n.v. D: density of facet normals; G1: Smith masking of one direction. Masking
// and shadowing are taken as independent: G = G1(wi) G1(wo).
// Walter et al. 2007, "Microfacet models for refraction through rough surfaces".
#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn::microfacet {

using std::exp;
using std::sqrt;

// GGX: D = alpha^2 / (pi (alpha^2 cos^2 + sin^2)^2), cos and sin of the angle between n and h.
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
// Mitsuba go on to a = 1.6 and jump there by 6e-5).
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

// The exact G1(v) / cos_v = 2 / (cos (1 + erf a) + alpha sin exp(-a^2) / sqrt(pi)): the
// normalisation of the density of visible normals.
double beckmann_exact_g1_over_cos(double cos_v, double alpha);

// The largest ratio of the rational to the exact G1.
inline constexpr double kBeckmannRationalExcess = 1.0035;

// Normals h visible from v (in the frame where n is +z, v.z > 0), with density
// D(h) G1(v) max(0, v.h) / v.z per solid angle of h, from two numbers in [0, 1).
Vec3d ggx_sample_visible(const Vec3d& v, double alpha, double u1, double u2);
Vec3d beckmann_sample_visible(const Vec3d& v, double alpha, double u1, double u2);

// Reflectance of a conductor for unpolarised light; refractive index eta + i k, relative to the
// outside; cos of the angle of incidence.
template <class S>
S fresnel_conductor(const S& cos_h, double eta, double k) {
  const S c2 = cos_h * cos_h;
  const S s2 = 1.0 - c2;
  const double nk = eta * k;
  const S t = eta * eta - k * k - s2;
  const S a2b2 = sqrt(t * t + 4 * nk * nk);
  // (a2b2 + t) / 2, without cancellation where t < 0.
  const S difference = a2b2 - t;
  const S a2 = value(t) < 0 ? S(2 * nk * nk / difference) : S((a2b2 + t) * 0.5);
  const S two_ac = 2.0 * sqrt(a2) * cos_h;
  const S rs = (a2b2 + c2 - two_ac) / (a2b2 + c2 + two_ac);
  const S p = a2b2 * c2 + s2 * s2;
  const S q = two_ac * s2;
  return rs * (1.0 + (p - q) / (p + q)) * 0.5;
}

}  // namespace limn::microfacet
