#pragma once
// What passes a rough dielectric boundary, tabulated as Mitsuba tabulates it.
#include <algorithm>
#include <array>

#include "src/bsdf/microfacet_reflection.h"

namespace limn {

// The parts of light that pass from outside, by the cosine of its direction, and that are reflected
// inside, of diffuse light: sums over 64 equidistant cosines, linear in between.
class RoughBoundary {
 public:
  // eta: the index inside over that outside.
  RoughBoundary(microfacet::Distribution distribution, double alpha, double eta);

  // At cos_v in [0, 1]. alpha, eta: those of the constructor, whose derivatives count.
  template <class S>
  S transmittance(const S& cos_v, const S& alpha, const S& eta) const {
    const S x = cos_v * (kCosines - 1.0);
    const int i = std::min(static_cast<int>(value(x)), kCosines - 2);
    const S weight = x - static_cast<double>(i);
    return at(i, alpha, eta) * (1.0 - weight) + at(i + 1, alpha, eta) * weight;
  }
  template <class S>
  S inner_reflectance(const S& alpha, const S& eta) const {
    return at(kCosines, alpha, eta);
  }
  // The largest transmittance.
  double most() const { return *std::max_element(values_.begin(), values_.begin() + kCosines); }

 private:
  static constexpr int kCosines = 64;
  // Transmittances, then the inner reflectance.
  using Table = std::array<double, kCosines + 1>;
  static Table table(microfacet::Distribution distribution, double alpha, double eta);
  template <class S>
  S at(int i, const S& alpha, const S& eta) const {
    if constexpr (std::is_same_v<S, double>) {
      return values_[i];
    } else {
      return {values_[i], alpha.d * by_alpha_[i] + eta.d * by_eta_[i]};
    }
  }

  Table values_, by_alpha_, by_eta_;
};

}  // namespace limn
