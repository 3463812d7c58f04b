// Fitting the dual box and the pair of quadrics of a set of wedges.
#include "edgetree/quadric/quadric_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "edgetree/forest/normaliser.h"

namespace limn {
namespace {

using Eigen::Matrix;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr float kInfinite = std::numeric_limits<float>::infinity();

Vector4d dual_point(const Plane& plane, const NodeFrame& frame) {
  return {plane.n.x, plane.n.y, plane.n.z, plane.distance(frame.center) * frame.inverse_radius};
}

// Puts the points u = (chart point - center) / half in place of the chart points, and the rows into
// the columns of the result.
Matrix4d box_around(std::vector<Vector3d>& points, const Vector4d& z,
                    const Matrix<double, 4, 3>& basis) {
  Vector3d low = points[0], high = points[0];
  for (const Vector3d& r : points) {
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  const Vector3d center = 0.5 * (low + high), half = 0.5 * (high - low);
  for (Vector3d& r : points)
    for (int k = 0; k < 3; ++k) r[k] = half[k] > 0 ? (r[k] - center[k]) / half[k] : 0;
  Matrix4d columns;
  columns.col(0) = z + basis * center;
  columns.rightCols<3>() = basis * half.asDiagonal();
  return columns;
}

// The polynomial of QuadricPairs for what `columns` makes of u; false if it is zero or no number.
bool put_polynomial(const Matrix4d& columns, const Matrix4d& quadric, QuadricFit& fit) {
  const Matrix4d g = columns.transpose() * quadric * columns;
  double values[9], sum = 0;
  for (int k = 0; k < 3; ++k) {
    values[k] = 2 * g(0, k + 1);
    values[3 + k] = g(k + 1, k + 1);
    values[6 + k] = 2 * g((k + 1) % 3 + 1, (k + 2) % 3 + 1);
  }
  for (const double value : values) sum += std::fabs(value);
  if (!(sum > 0x1.0p-500 && sum < 0x1.0p500)) return false;
  // A little less than 1: rounding to floats must not raise the sum above it.
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

// Of f over the segments between points 2 i and 2 i + 1: the ends, and the parabola's vertex where
// that lies between them. (The paper's Appendix D has the same as a quotient of forms.)
void put_bounds(const std::vector<Vector3d>& points, QuadricFit& fit) {
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
  // More than the rounding of these values; then outward to floats.
  constexpr double kRounding = 0x1.0p-40;
  fit.low = std::nextafter(static_cast<float>(low - kRounding), -kInfinite);
  fit.high = std::nextafter(static_cast<float>(high + kRounding), kInfinite);
}

void put_rows(const Matrix4d& columns, QuadricFit& fit) {
  double sum = 0;
  for (int i = 0; i < 4; ++i) sum += columns.col(i).norm();
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) fit.rows[i][k] = columns(k, i) / sum;
}

}  // namespace

QuadricFit unrejectable_quadric_fit() {
  QuadricFit fit{};
  fit.rows[1][3] = 1;
  fit.low = -kInfinite;
  fit.high = kInfinite;
  return fit;
}

QuadricFit fit_quadrics(std::span<const Wedge> wedges, const NodeFrame& frame,
                        const PlaneMoments* moments, const NodeFrame& own) {
  static thread_local std::vector<Vector4d> planes;
  static thread_local std::vector<Vector3d> points;
  planes.clear();
  for (const Wedge& wedge : wedges)
    for (const Plane& plane : wedge.planes) planes.push_back(dual_point(plane, frame));
  QuadricFit fit = unrejectable_quadric_fit();
  const Vector4d z = normaliser_of(planes);
  if (z.norm() == 0) return fit;
  const Matrix<double, 4, 3> basis = complement_of(z);
  points.clear();
  for (const Vector4d& q : planes) points.push_back(basis.transpose() * q / q.dot(z));
  const Matrix4d columns = box_around(points, z, basis);
  put_rows(columns, fit);
  if (!moments) return fit;
  const Matrix4d change = between(frame, own);
  const Matrix4d quadric = change.transpose() * moments->best_quadric() * change;
  if (put_polynomial(columns, quadric, fit)) put_bounds(points, fit);
  return fit;
}

PlaneMoments moments_of(std::span<const Wedge> wedges, const NodeFrame& frame) {
  PlaneMoments moments;
  for (const Wedge& wedge : wedges)
    for (const Plane& plane : wedge.planes) moments.add(dual_point(plane, frame));
  return moments;
}

}  // namespace limn
