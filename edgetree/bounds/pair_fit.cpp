// A pair of bounding quadrics as a polynomial in a dual box's coordinates, with bounds.
#include "edgetree/bounds/pair_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace limn {
namespace {

using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Box axes shorter than this, relative to the box's distance from the origin, are ignored.
// Coordinates along them are rounding errors and may be far outside of [-1, 1]; along other axes
// they are exact to 2^-24, within kMargin (quadric_pair.cpp). The effect on g is covered by the
// margin of queries for the rounding of rows.
constexpr double kThin = 0x1.0p-28;

constexpr float kInfinite = std::numeric_limits<float>::infinity();

// The polynomial of QuadricPairs under the map `columns`; false if it is zero or NaN.
bool put_polynomial(const Matrix4d& columns, const Matrix4d& quadric, PairFit& fit) {
  const Matrix4d g = columns.transpose() * quadric * columns;
  double values[9], sum = 0;
  for (int k = 0; k < 3; ++k) {
    values[k] = 2 * g(0, k + 1);
    values[3 + k] = g(k + 1, k + 1);
    values[6 + k] = 2 * g((k + 1) % 3 + 1, (k + 2) % 3 + 1);
  }
  for (const double value : values) sum += std::fabs(value);
  if (!(sum > 0x1.0p-500 && sum < 0x1.0p500)) return false;
  // Slightly less than 1 in total, since rounding to floats must not exceed 1.
  const double scale = (1 - 0x1.0p-20) / sum;
  for (int i = 0; i < 9; ++i) fit.coefficients[i] = static_cast<float>(values[i] * scale);
  return true;
}

double evaluate(const float (&c)[9], const Vector3d& u) {
  double sum = 0;
  for (int k = 0; k < 3; ++k)
    sum += u[k] * (c[k] + c[3 + k] * u[k]) + c[6 + k] * u[(k + 1) % 3] * u[(k + 2) % 3];
  return sum;
}

// Bounds of f over the segments between points 2 i and 2 i + 1: values at the ends, and at the
// parabola's vertex if it is between. (Appendix D of the paper uses quotients of forms.)
void put_bounds(const std::vector<Vector3d>& points, PairFit& fit) {
  double low = std::numeric_limits<double>::max(), high = -low;
  const auto add = [&](double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  };
  for (size_t i = 0; i + 1 < points.size(); i += 2) {
    const double f_0 = evaluate(fit.coefficients, points[i]);
    const double f_1 = evaluate(fit.coefficients, points[i + 1]);
    const double middle = evaluate(fit.coefficients, 0.5 * (points[i] + points[i + 1]));
    add(f_0);
    add(f_1);
    // f = f_0 + c_1 t + c_2 t^2.
    const double c_2 = 2 * (f_0 + f_1 - 2 * middle), c_1 = f_1 - f_0 - c_2;
    const double t = -c_1 / (2 * c_2);
    if (t > 0 && t < 1) add(f_0 + t * (c_1 + t * c_2));
  }
  // Covers the rounding of these values, then rounds outward to floats.
  constexpr double kRounding = 0x1.0p-40;
  fit.low = std::nextafter(static_cast<float>(low - kRounding), -kInfinite);
  fit.high = std::nextafter(static_cast<float>(high + kRounding), kInfinite);
}

}  // namespace

PairFit fit_pair(Matrix4d columns, const Matrix4d& quadric, std::vector<Vector3d>& points) {
  for (int k = 0; k < 3; ++k) {
    if (columns.col(k + 1).norm() > kThin * columns.col(0).norm()) continue;
    columns.col(k + 1).setZero();
    for (Vector3d& u : points) u[k] = 0;
  }
  PairFit fit;
  if (put_polynomial(columns, quadric, fit)) put_bounds(points, fit);
  return fit;
}

Vector4d dual_point(const Plane& plane, const NodeFrame& frame) {
  return {plane.n.x, plane.n.y, plane.n.z, plane.distance(frame.center) * frame.inverse_radius};
}

PlaneMoments moments_of(std::span<const Wedge> wedges, const NodeFrame& frame) {
  PlaneMoments moments;
  for (const Wedge& wedge : wedges)
    for (const Plane& plane : wedge.planes) moments.add(dual_point(plane, frame));
  return moments;
}

}  // namespace limn
