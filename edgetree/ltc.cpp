#include "ltc.h"

#include <algorithm>
#include <cmath>

#include "ltc_table.h"

// Boxes. Where the lobe's axis z' is well above the box, map directions to slopes (x', y') / z'.
// There the transformed cosine has the density 1 / (pi (1 + r^2)^2), which is the area measure of
// the sphere under stereographic projection, and that maps discs to caps. So the mass of a disc of
// radius rho around a slope at distance r from the origin is the area of a cap,
//   mass = 2 rho^2 / (s (s + q)),   q = 1 + r^2 - rho^2,   s^2 = q^2 + 4 rho^2.
// A box is taken for the disc with the same variance across the axis. Multiplying all lengths by
// z' removes the division by it, and clipping z' to its mean above the lobe's own horizon keeps the
// formula alive for boxes that cross it. rho = 0 gives the density of the box's centre.

namespace limn {
namespace {

#include "ltc_tables.inc"

Float4 dot3(const float a[3], const Float4x3& b) { return b.x * a[0] + b.y * a[1] + b.z * a[2]; }
Float4 abs_dot3(const float a[3], const Float4x3& b) {
  return b.x * std::fabs(a[0]) + b.y * std::fabs(a[1]) + b.z * std::fabs(a[2]);
}
// Mean of max(0, z) for z uniform in middle +- reach.
Float4 mean_above_zero(Float4 middle, Float4 reach) {
  const Float4 upper = max(middle + reach, splat(0.0f));
  return middle >= reach ? middle : upper * upper / max(4 * reach, splat(0x1p-126f));
}

}  // namespace

LtcLobe::LtcLobe(const LobeSummary& lobe, const Vec3d& n, const Vec3d& wi)
    : diffuse_(lobe.kind == LobeSummary::Kind::kDiffuse), n_(n) {
  if (diffuse_) {
    const Frame frame(n);
    rows_[0] = frame.s;
    rows_[1] = frame.t;
    rows_[2] = n;
  } else {
    read_table(lobe, wi);
  }
  prepare_boxes();
}

// With X, Y, Z the columns of R, M^-1 = [1/width_x 0 -skew/width_x; 0 1/width_y 0; 0 0 1] R^T.
void LtcLobe::read_table(const LobeSummary& lobe, const Vec3d& wi) {
  const double alpha = std::min(lobe.alpha, kLtcMaxAlpha);
  const double cos_i = std::clamp(dot(n_, wi), 1e-6, 1.0);
  const LtcEntry entry =
      interpolate(lobe.kind == LobeSummary::Kind::kGgx ? kGgxTable : kBeckmannTable, alpha, cos_i);
  const LtcShape shape = scaled(entry, alpha, cos_i);
  norm_ = entry.norm;

  const Vec3d across = wi - n_ * dot(n_, wi);
  const double sin_i = length(across);
  const Vec3d away = sin_i > 0 ? across / -sin_i : Frame(n_).s;
  const double cos_tilt = std::cos(shape.tilt), sin_tilt = std::sin(shape.tilt);
  const double c = cos_i * cos_tilt - sin_i * sin_tilt, s = sin_i * cos_tilt + cos_i * sin_tilt;
  rows_[2] = n_ * c + away * s;
  rows_[1] = cross(n_, away) / shape.width_y;
  rows_[0] = (away * c - n_ * s - rows_[2] * shape.skew) / shape.width_x;
  det_ = 1 / (shape.width_x * shape.width_y);
}

// The variance of a box along its axis i is half_i^2 / 3, that of a disc rho^2 / 4 along each of
// its two axes: rho^2 = 2 / 3 sum over i, both rows, of (row_i half_i)^2.
void LtcLobe::prepare_boxes() {
  det_f_ = static_cast<float>(det_);
  for (int i = 0; i < 3; ++i) {
    n_f_[i] = static_cast<float>(n_[i]);
    for (int k = 0; k < 3; ++k) rows_f_[k][i] = static_cast<float>(rows_[k][i]);
    spread_f_[i] =
        static_cast<float>((rows_[0][i] * rows_[0][i] + rows_[1][i] * rows_[1][i]) * (2.0 / 3));
  }
}

double LtcLobe::ltc(const Vec3d& w) const {
  const Vec3d v = transform(w);
  if (v.z <= 0) return 0;
  const double r2 = length_squared(v);
  return v.z * det_ / (kPi * r2 * r2);
}

double LtcLobe::value(const Vec3d& w) const {
  const double height = dot(n_, w);
  if (height <= 0) return 0;
  if (diffuse_) return height / kPi;
  return (1 - kLtcFloor) * ltc(w) + kLtcFloor * height / kPi;
}

Float4 LtcLobe::mean_over_boxes(Float4x3 centre, Float4x3 half) const {
  constexpr float kInversePi = static_cast<float>(1 / kPi);
  // Lengths relative to one between the distance and the size of the box. The cosine's mean is then
  // about the mean height, from far away to a box around p.
  const Float4 size2 = dot(centre, centre) + dot(half, half);
  const Float4 scale = 1 / sqrt(max(size2, splat(0x1p-126f)));
  centre = centre * scale;
  half = half * scale;
  const Float4 reach = abs_dot3(n_f_, half);
  // Rounding above is below this.
  const Float4 middle = dot3(n_f_, centre) + 0x1p-21f;
  const Float4 cosine = mean_above_zero(middle, reach + 0x1p-21f) * kInversePi;
  if (diffuse_) return cosine;

  const Float4 z = mean_above_zero(dot3(rows_f_[2], centre), abs_dot3(rows_f_[2], half));
  const Float4 x = dot3(rows_f_[0], centre), y = dot3(rows_f_[1], centre);
  const Float4 half2_x = half.x * half.x, half2_y = half.y * half.y, half2_z = half.z * half.z;
  const Float4 rho2 = half2_x * spread_f_[0] + half2_y * spread_f_[1] + half2_z * spread_f_[2];
  const Float4 r2 = x * x + y * y, z2 = z * z;
  const Float4 q = z2 + r2 - rho2;
  const Float4 s = sqrt(q * q + 4 * rho2 * z2);
  // 1 / (s + q), without cancellation for negative q.
  const Float4 inverse = q > 0 ? 1 / (s + q) : (s - q) / (4 * rho2 * z2);
  const Float4 d2 = dot(centre, centre), d3 = d2 * sqrt(d2);
  const Float4 far = 2 * kInversePi * det_f_ * d3 * z * inverse / s;
  // No mean exceeds the whole mass spread over the box's solid angle: 2 |half|^2 for a distant
  // cube, 4 pi around p.
  const Float4 half2 = half2_x + half2_y + half2_z;
  const Float4 solid_angle = half2 * (2 + (static_cast<float>(4 * kPi) - 2) * half2);
  const Float4 above = min((middle + reach) / (2 * reach), splat(1.0f));
  const Float4 lobe = z > 0 ? min(far, 1 / solid_angle) * max(above, splat(0.0f)) : splat(0.0f);
  return static_cast<float>(1 - kLtcFloor) * lobe + static_cast<float>(kLtcFloor) * cosine;
}

}  // namespace limn
