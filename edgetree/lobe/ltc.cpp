// Transformed cosines of a query: lookup, values, means over boxes.
#include "edgetree/lobe/ltc.h"

#include <algorithm>
#include <cmath>

#include "edgetree/lobe/ltc_table.h"

// Boxes. Map directions to slopes (x, y) / z of w' = M^-1 w. There the transformed cosine has the
// density 1 / (pi (1 + r^2)^2). A box is taken for a rectangle of slopes with the variances that
// its points have along the two axes, perspective to first order. The mass of the rectangle is
// approximated by a product of the exact marginal of the coordinate that is farther out, x,
//   integral over y = 1 / (2 (1 + x^2)^(3/2)) = d/dx of x / (2 sqrt(1 + x^2)),
// and for the other, given the x closest to the axis, the same shape stretched by sqrt(1 + x^2)
// (exact would be the power -2 for -3/2, which needs an arctangent).
// Lengths stay multiplied by z; z is clipped to its mean above the lobe's own horizon, which keeps
// all of it alive for boxes that cross that.

namespace limn {
namespace {

#include "edgetree/lobe/ltc_tables.inc"

Floats dot3(const float a[3], const Floats3& b) { return b.x * a[0] + b.y * a[1] + b.z * a[2]; }
Floats abs_dot3(const float a[3], const Floats3& b) {
  return b.x * std::fabs(a[0]) + b.y * std::fabs(a[1]) + b.z * std::fabs(a[2]);
}
// Mean of max(0, z) for z uniform in middle +- reach.
Floats mean_above_zero(Floats middle, Floats reach) {
  const Floats upper = max(middle + reach, splat(0.0f));
  return middle >= reach ? middle : upper * upper / max(4 * reach, splat(0x1p-126f));
}

// Mean of d/dx of x / sqrt(z^2 + x^2) over middle +- reach, middle >= 0, reach > 0.
Floats mean_slope(Floats middle, Floats reach, Floats z) {
  const Floats x1 = middle - reach, x2 = middle + reach, z2 = z * z;
  const Floats s1 = sqrt(z2 + x1 * x1), s2 = sqrt(z2 + x2 * x2);
  const Floats a = x2 * s1, b = x1 * s2;
  // Two forms of (a - b) / (2 reach) without cancellation, depending on the sign of x1.
  return (x1 > 0 ? 2 * middle * z2 / (a + b) : (a - b) / (2 * reach)) / (s1 * s2);
}

// Extent of a box (three half extents) or a segment (one) along a row, and the squared
// half-width of the uniform distribution with its variance, given its half extents along the
// row.
struct Box {
  static Floats reach(const float row[3], const Floats3& half) { return abs_dot3(row, half); }
  static Floats width2(Floats a, Floats b, Floats c) { return a * a + b * b + c * c; }
};
struct Segment {
  static Floats reach(const float row[3], const Floats3& half) { return abs(dot3(row, half)); }
  static Floats width2(Floats a, Floats b, Floats c) { return (a + b + c) * (a + b + c); }
};

// Half-width of the uniform distribution with the shape's variance along `row`, as a slope relative
// to `axis` around the center's slope, times z. A floor of 3 % of the lobe's width (in units of z)
// changes no mean and avoids 0 / 0.
template <class Shape>
Floats reach_across(const float row[3], const float axis[3], Floats slope, const Floats3& half,
                    Floats z) {
  const Floats a = (row[0] - slope * axis[0]) * half.x, b = (row[1] - slope * axis[1]) * half.y,
               c = (row[2] - slope * axis[2]) * half.z;
  return sqrt(Shape::width2(a, b, c) + 1e-3f * z * z);
}

// Divides lengths by a value between the distance and the size of the shape.
void normalise(Floats3& center, Floats3& half) {
  const Floats size2 = dot(center, center) + dot(half, half);
  const Floats scale = 1 / sqrt(max(size2, splat(0x1p-126f)));
  center = center * scale;
  half = half * scale;
}

constexpr float kInversePi = static_cast<float>(1 / kPi);
constexpr float kSphere = static_cast<float>(4 * kPi);

}  // namespace

LtcLobe::LtcLobe(const LobeSummary& lobe, const Vec3d& n, const Vec3d& wi) : n_(n) {
  const std::optional<LtcRow> row = lobe.model->ltc(lobe);
  diffuse_ = !row;
  if (!row) {
    const Frame frame(n);
    rows_[0] = frame.s;
    rows_[1] = frame.t;
    rows_[2] = n;
  } else {
    read_table(*row, wi);
    cosine_ = lobe.cosine_share(dot(n, wi));
  }
  prepare_boxes();
}

// With X, Y, Z the columns of R, M^-1 = [1/width_x 0 -skew/width_x; 0 1/width_y 0; 0 0 1] R^T.
void LtcLobe::read_table(const LtcRow& row, const Vec3d& wi) {
  const double alpha = std::min(row.alpha, kLtcMaxAlpha);
  const double cos_i = std::clamp(dot(n_, wi), 1e-6, 1.0);
  const LtcEntry entry =
      interpolate(row.table == LtcRow::Table::kGgx ? kGgxTable : kBeckmannTable, alpha, cos_i);
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

void LtcLobe::prepare_boxes() {
  det_f_ = static_cast<float>(det_);
  cosine_f_ = static_cast<float>(cosine_);
  rest_f_ = static_cast<float>(1 - cosine_);
  for (int i = 0; i < 3; ++i) {
    n_f_[i] = static_cast<float>(n_[i]);
    for (int k = 0; k < 3; ++k) rows_f_[k][i] = static_cast<float>(rows_[k][i]);
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
  return (1 - cosine_) * ltc(w) + cosine_ * height / kPi;
}

double LtcLobe::homogeneous_value(const Vec3d& w) const {
  const double height = dot(n_, w);
  if (height <= 0) return 0;
  const double w2 = length_squared(w), cosine = height / (kPi * w2 * w2);
  return diffuse_ ? cosine : (1 - cosine_) * ltc(w) + cosine_ * cosine;
}

Floats LtcLobe::mean_over_boxes(Floats3 center, Floats3 half) const {
  return mean_over<Box>(center, half);
}
Floats LtcLobe::mean_over_segments(Floats3 center, Floats3 half) const {
  return mean_over<Segment>(center, half);
}

template <class Shape>
Floats LtcLobe::mean_over(Floats3 center, Floats3 half) const {
  // The cosine's mean is then the mean height, for distant shapes and for those around p.
  normalise(center, half);
  // This offset exceeds the rounding.
  const Floats middle = dot3(n_f_, center) + 0x1p-21f;
  const Floats reach = Shape::reach(n_f_, half) + 0x1p-21f;
  const Floats cosine = mean_above_zero(middle, reach) * kInversePi;
  if (diffuse_) return cosine;
  const Floats mixed = rest_f_ * ltc_mean<Shape>(center, half) + cosine_f_ * cosine;
  return select(middle + reach > 0, mixed, splat(0.0f));
}

// For each box, the slopes closest to the lobe's axis and the height z above its horizon that
// maximises z / (r^2 + z^2)^2: z^2 = r^2 / 3. Lobes without skew never exceed their value at the
// axis.
Floats LtcLobe::most_in_boxes(Floats3 center, Floats3 half) const {
  normalise(center, half);
  const Floats distance = sqrt(dot(center, center)), radius = sqrt(dot(half, half));
  const Floats height = dot3(n_f_, center) + abs_dot3(n_f_, half);
  const Floats nearest = max(distance - radius, splat(0x1p-20f));
  const Floats cosine = clamp(height / nearest, splat(0.0f), splat(1.0f)) * kInversePi;
  if (diffuse_) return cosine;
  const auto outside = [&](const float row[3]) {
    return max(abs(dot3(row, center)) - abs_dot3(row, half), splat(0.0f));
  };
  const Floats x = outside(rows_f_[0]), y = outside(rows_f_[1]), r2 = x * x + y * y;
  const Floats middle_z = dot3(rows_f_[2], center), reach_z = abs_dot3(rows_f_[2], half);
  const Floats low = max(middle_z - reach_z, splat(0x1p-20f));
  const Floats z = max(low, min(sqrt(r2 * (1.0f / 3)), middle_z + reach_z));
  const Floats l2 = r2 + z * z, far = distance + radius;
  const Floats peak = min(far * far * far * z / (l2 * l2), splat(1.0f)) * (det_f_ * kInversePi);
  return rest_f_ * peak + cosine_f_ * cosine;
}

// Mean of `ltc` alone; requires |center|^2 + |half|^2 = 1.
template <class Shape>
Floats LtcLobe::ltc_mean(const Floats3& center, const Floats3& half) const {
  const Floats middle_z = dot3(rows_f_[2], center), reach_z = Shape::reach(rows_f_[2], half);
  const Floats z = mean_above_zero(middle_z, reach_z);
  // 1 / z for boxes far from the lobe's horizon, 0 for those that meet it.
  const Floats inverse_z =
      max(middle_z - reach_z, splat(0.0f)) / max(middle_z * middle_z, splat(0x1p-126f));
  const Floats signed_x = dot3(rows_f_[0], center), signed_y = dot3(rows_f_[1], center);
  const Floats reach_x = reach_across<Shape>(rows_f_[0], rows_f_[2], signed_x * inverse_z, half, z);
  const Floats reach_y = reach_across<Shape>(rows_f_[1], rows_f_[2], signed_y * inverse_z, half, z);
  const Floats x = abs(signed_x), y = abs(signed_y);

  const Ints swap = y > x;
  const Floats far = select(swap, y, x), near = select(swap, x, y);
  const Floats reach_far = select(swap, reach_y, reach_x);
  const Floats reach_near = select(swap, reach_x, reach_y);
  const Floats closest = max(far - reach_far, splat(0.0f));
  const Floats density = 0.25f * mean_slope(far, reach_far, z) *
                         mean_slope(near, reach_near, sqrt(z * z + closest * closest));
  // From slopes to solid angle: det |w|^3 / z^3 for a distant box, the whole mass over 4 pi for one
  // around p. No mean exceeds mass 1 over the box's solid angle: about 2 |half|^2 for a distant
  // cube, 4 pi around p.
  const Floats d2 = dot(center, center), half2 = dot(half, half);
  const Floats distant = density * d2 * sqrt(d2) * det_f_ / z;
  const Floats around = density * reach_far * reach_near * (4 / kSphere);
  const Floats solid_angle = half2 * (2 + (kSphere - 2) * half2);
  return select(z > 0, min(distant + around, 1 / solid_angle), splat(0.0f));
}

}  // namespace limn
