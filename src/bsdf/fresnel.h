#pragma once
// What a smooth surface between two media without absorption reflects and passes, over double or
// Dual.
#include <algorithm>
#include <cmath>

#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

template <class S>
struct Fresnel {
  S reflected = S(1.0);  // of unpolarised light
  S cos_t = S(0.0);      // cosine of the refracted direction with the reversed normal
  bool total = true;     // nothing passes
};

// cos_i: cosine of the angle of incidence, >= 0. eta: the index of refraction behind the surface
// over that in front.
template <class S>
Fresnel<S> fresnel_dielectric(const S& cos_i, const S& eta) {
  using std::sqrt;
  const S square = 1.0 - (1.0 - cos_i * cos_i) / (eta * eta);
  if (!(value(square) > 0)) return {};
  const S cos_t = sqrt(square);
  const S s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
  const S p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
  return {0.5 * (s * s + p * p), cos_t, false};
}

// Whether a facet reflects or passes light, by the coarse digit of a number that also draws the
// facet: its probability has steps of 1 / kSteps, so the rest of the number stays uniform.
class FacetSide {
 public:
  static constexpr int kSteps = 40;

  // Of a facet that reflects, passes so much; neither is chosen with less than 0.1, as derivatives
  // need not be small where the value is. Not tuned.
  FacetSide(double reflects, double passes)
      : reflecting_(passes == 0    ? kSteps
                    : reflects > 0 ? std::clamp(static_cast<int>(std::lround(
                                                    kSteps * (reflects / (reflects + passes)))),
                                                kSteps / 10, kSteps - kSteps / 10)
                                   : kSteps / 10) {}

  double reflecting() const { return static_cast<double>(reflecting_) / kSteps; }
  double passing() const { return static_cast<double>(kSteps - reflecting_) / kSteps; }
  bool reflects(int digit) const { return digit < reflecting_; }

 private:
  int reflecting_;  // digits for which it does
};

// u in [0, 1) as a digit below FacetSide::kSteps and the rest, in [0, 1).
struct FacetDigit {
  explicit FacetDigit(double u)
      : digit(std::min(static_cast<int>(u * FacetSide::kSteps), FacetSide::kSteps - 1)),
        rest(u * FacetSide::kSteps - digit) {}
  int digit;
  double rest;
};

// What the border reflects of diffuse light from inside, eta > 1: Mitsuba's fit.
template <class S>
S inner_diffuse_reflectance(const S& eta) {
  const S inverse = 1.0 / eta;
  return 0.0636 * eta + 0.6681 + inverse * (0.7099 - 1.4399 * inverse);
}

// The mirror image of w about n; both unit.
template <class S>
Vec3<S> reflected(const Vec3<S>& w, const Vec3<S>& n) {
  return n * (2.0 * dot(n, w)) - w;
}

// Where light comes from that leaves along w after refraction.
template <class S>
Vec3<S> refracted(const Vec3<S>& w, const Vec3<S>& n, const S& eta, const S& cos_t) {
  const S ratio = 1.0 / eta;
  return n * (ratio * dot(n, w) - cos_t) - w * ratio;
}

}  // namespace limn
