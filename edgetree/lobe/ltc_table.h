#pragma once
// The table of fitted lobes: what its entries mean and how it is read. Written by
// tools/fit_ltc/fit_ltc.cpp.
#include <algorithm>
#include <cmath>

namespace limn {

// Every lobe is evaluated as (1 - kLtcFloor) LTC + kLtcFloor cos / pi: where the fit misses the
// true lobe, the importance stays positive. The floor is not tuned.
inline constexpr double kLtcFloor = 0.1;

// A matrix M = R [width_x 0 skew; 0 width_y 0; 0 0 1]; R turns +z by theta_i + tilt from the normal
// towards the mirror direction, in the plane of incidence. Any M of Heitz et al. 2016 is of this
// form up to a factor that cancels (an RQ decomposition).
struct LtcShape {
  double tilt;  // radians
  double width_x, width_y;
  double skew;
};

// All scale with the roughness, the width across the plane of incidence also with the cosine of
// incidence; stored without these factors they are smooth.
struct LtcEntry {
  float tilt;     // over alpha
  float width_x;  // over alpha
  float width_y;  // over alpha sqrt(cos_i^2 + alpha^2)
  float skew;     // over alpha
  float norm;     // integral of the lobe for F = 1
};

// Entries per axis; roughness is the slow one.
inline constexpr int kLtcSize = 24;
inline constexpr double kLtcMinAlpha = 1e-3, kLtcMaxAlpha = 1;

// Coordinates in [0, 1]: fourth root of the roughness, and a logarithm that resolves cosines of
// incidence around alpha, where masking sets in.
inline double ltc_alpha(double u) {
  const double low = std::sqrt(std::sqrt(kLtcMinAlpha));
  const double root = low + (1 - low) * u;
  return root * root * root * root;
}
inline double ltc_alpha_coordinate(double alpha) {
  static const double low = std::sqrt(std::sqrt(kLtcMinAlpha));
  return (std::sqrt(std::sqrt(alpha)) - low) / (1 - low);
}
inline double ltc_cosine(double v, double alpha) {
  return std::clamp(alpha * std::expm1(v * std::log1p(1 / alpha)), 1e-3 * alpha, 1.0);
}
inline double ltc_cosine_coordinate(double cos_i, double alpha) {
  return std::log1p(cos_i / alpha) / std::log1p(1 / alpha);
}

inline LtcShape scaled(const LtcEntry& e, double alpha, double cos_i) {
  return {e.tilt * alpha, e.width_x * alpha,
          e.width_y * alpha * std::sqrt(cos_i * cos_i + alpha * alpha), e.skew * alpha};
}

// Bilinear; alpha is clamped to the table, cos_i in (0, 1].
inline LtcEntry interpolate(const LtcEntry* table, double alpha, double cos_i) {
  const double a = std::clamp(alpha, kLtcMinAlpha, kLtcMaxAlpha);
  const double row = std::clamp(ltc_alpha_coordinate(a), 0.0, 1.0) * (kLtcSize - 1);
  const double column = std::clamp(ltc_cosine_coordinate(cos_i, a), 0.0, 1.0) * (kLtcSize - 1);
  const int i = std::min(static_cast<int>(row), kLtcSize - 2);
  const int j = std::min(static_cast<int>(column), kLtcSize - 2);
  const float y = static_cast<float>(row - i), x = static_cast<float>(column - j);
  const LtcEntry* e = table + i * kLtcSize + j;
  const float k[4] = {(1 - y) * (1 - x), (1 - y) * x, y * (1 - x), y * x};
  const auto mix = [&](float LtcEntry::*m) {
    return k[0] * e[0].*m + k[1] * e[1].*m + k[2] * e[kLtcSize].*m + k[3] * e[kLtcSize + 1].*m;
  };
  return {mix(&LtcEntry::tilt), mix(&LtcEntry::width_x), mix(&LtcEntry::width_y),
          mix(&LtcEntry::skew), mix(&LtcEntry::norm)};
}

}  // namespace limn
