// The dual box of a set of edges: the normaliser, the axes, the rows.
#include "edgetree/forest/forest_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "edgetree/forest/linear_program.h"

// A plane is q = (n, signed distance of the frame's center / radius), so that q . x is the signed
// distance of p / radius. Dividing by Z . q > 0 puts all planes on the hyperplane Z . q = 1, an
// affine 3-space (the chart), where a wedge is the segment between the planes of its two faces.
// The chart points are Z + t_1 r_1 + t_2 r_2 + t_3 r_3 for an orthonormal basis (t_1, t_2, t_3, Z).
// A box r = c + sum of e_k u_k a_k, |u_k| <= 1, along axes a_k, becomes in R^4
//   row_0 = Z + sum of c_i t_i,   row_k = e_k sum of a_k,i t_i.

namespace limn {
namespace {

using Eigen::Matrix;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Chart points are right to 2^-52 / (Z . q): with less than this of Z . q they could be off by a
// rounding of floats, which the query's own bound must cover.
constexpr double kMinSeparation = 0x1.0p-20;

// Flat edges count a little, for the points on their plane. Not tuned.
constexpr double kFlat = 0x1.0p-12;

Vector4d dual_point(const Plane& plane, const NodeFrame& frame) {
  return {plane.n.x, plane.n.y, plane.n.z, plane.distance(frame.center) * frame.inverse_radius};
}

struct Farthest {
  double value;
  size_t index;
};
Farthest least_product(const std::vector<Vector4d>& points, const Vector4d& z) {
  Farthest least{points[0].dot(z), 0};
  for (size_t i = 1; i < points.size(); ++i) {
    const double product = points[i].dot(z);
    if (product < least.value) least = {product, i};
  }
  return least;
}

// The direction whose largest angle with all normals is smallest, roughly: the center of the
// smallest enclosing ball of the normals by Badoiu and Clarkson's steps towards the farthest.
Vector4d central_direction(const std::vector<Vector4d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector4d& q : points) mean += q.head<3>();
  Vector3d center = mean / static_cast<double>(points.size());
  constexpr int kSteps = 12;  // not tuned
  for (int i = 2; i < 2 + kSteps && points.size() > 2; ++i) {
    // Normals are unit vectors: the farthest has the smallest product with the center.
    const Farthest far = least_product(points, Vector4d(center[0], center[1], center[2], 0));
    center += (points[far.index].head<3>() - center) / i;
  }
  const double norm = center.norm();
  if (norm == 0) return Vector4d::Zero();
  return Vector4d(center[0], center[1], center[2], 0) / norm;
}

// The linear program over all points, by adding the most violated ones until none is left.
Vector4d farthest_hyperplane(const std::vector<Vector4d>& points) {
  std::vector<Vector4d> active;
  for (int i = 0; i < 4; ++i) {
    const auto by = [&](const Vector4d& a, const Vector4d& b) { return a[i] < b[i]; };
    const auto [low, high] = std::minmax_element(points.begin(), points.end(), by);
    active.push_back(*low);
    active.push_back(*high);
  }
  constexpr int kRounds = 24;  // not tuned
  for (int round = 0;; ++round) {
    Vector4d z = separating_direction(active);
    if (z.norm() == 0) return z;
    const double rho = least_product(active, z).value;
    const Farthest least = least_product(points, z);
    // Any Z that works will do: nearly optimal is enough.
    if (least.value > 0.5 * rho || round == kRounds) return z / z.norm();
    active.push_back(points[least.index]);
  }
}

// Unit Z with Z . q > 0 for all points, or zero.
Vector4d normaliser_of(const std::vector<Vector4d>& points) {
  Vector4d z = central_direction(points);
  const double least = z.norm() > 0 ? least_product(points, z).value : 0;
  // The chart would be five times as large as it needs to be. Not tuned.
  constexpr double kWide = 0.2;
  if (least >= kWide) return z;
  const Vector4d other = farthest_hyperplane(points);
  const double other_least = other.norm() > 0 ? least_product(points, other).value : 0;
  if (std::max(least, other_least) < kMinSeparation) return Vector4d::Zero();
  return least >= other_least ? z : other;
}

// Columns: orthonormal, and orthogonal to the unit vector z (a Householder reflection).
Matrix<double, 4, 3> complement_of(const Vector4d& z) {
  int k = 0;
  z.cwiseAbs().maxCoeff(&k);
  Vector4d v = z;
  v[k] += std::copysign(1.0, z[k]);
  Matrix<double, 4, 3> basis;
  for (int column = 0, i = 0; i < 4; ++i) {
    if (i == k) continue;
    basis.col(column++) = Vector4d::Unit(i) - v * (2 * v[i] / v.squaredNorm());
  }
  return basis;
}

// Principal axes of points, the widest first.
Eigen::Matrix3d principal_axes(const std::vector<Vector3d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector3d& r : points) mean += r;
  mean /= static_cast<double>(points.size());
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Vector3d& r : points) covariance += (r - mean) * (r - mean).transpose();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
  return solver.eigenvectors().rowwise().reverse();
}

void fit_box(std::vector<Vector3d>& points, const Vector4d& z, const ForestConfig& config,
             DualFit& fit) {
  const Matrix<double, 4, 3> basis = complement_of(z);
  const Eigen::Matrix3d axes =
      config.principal_axes ? principal_axes(points) : Eigen::Matrix3d::Identity();
  Vector3d low = Vector3d::Constant(1e300), high = -low;
  for (Vector3d& r : points) {
    r = axes.transpose() * r;
    low = low.cwiseMin(r);
    high = high.cwiseMax(r);
  }
  const Vector3d center = 0.5 * (low + high), half = 0.5 * (high - low);
  const Matrix<double, 4, 3> columns = basis * axes;
  Vector4d::Map(fit.rows[0]) = z + columns * center;
  for (int k = 0; k < 3; ++k) {
    Vector4d::Map(fit.rows[k + 1]) = columns.col(k) * half[k];
    for (Vector3d& r : points) r[k] = half[k] > 0 ? (r[k] - center[k]) / half[k] : 0;
  }
}

void sum_cover(std::span<const Wedge> wedges, const std::vector<Vector3d>& points, DualFit& fit) {
  for (int k = 0; k < 3; ++k) {
    fit.cover[k] = 0;
    for (size_t i = 0; i < wedges.size(); ++i) {
      const double part = 0.5 * std::fabs(points[2 * i][k] - points[2 * i + 1][k]);
      fit.cover[k] += wedges[i].length * std::max(part, kFlat);
    }
  }
}

void scale_rows(DualFit& fit) {
  double sum = 0;
  for (const auto& row : fit.rows) sum += Vector4d::Map(row).norm();
  for (auto& row : fit.rows)
    for (double& r : row) r /= sum;
}

}  // namespace

DualFit unrejectable_fit(double cover) {
  DualFit fit{};
  fit.cover[0] = cover;
  fit.rows[1][3] = 1;
  return fit;
}

DualFit fit_dual(std::span<const Wedge> wedges, const NodeFrame& frame,
                 const ForestConfig& config) {
  static thread_local std::vector<Vector4d> planes;
  static thread_local std::vector<Vector3d> points;
  planes.clear();
  for (const Wedge& wedge : wedges)
    for (const Plane& plane : wedge.planes) planes.push_back(dual_point(plane, frame));
  const Vector4d z = normaliser_of(planes);
  double angles = 0;
  for (const Wedge& wedge : wedges) angles += wedge.length * std::max(wedge.angle / kPi, kFlat);
  DualFit fit = unrejectable_fit(angles);
  if (z.norm() == 0) return fit;
  for (Vector4d& q : planes) q /= q.dot(z);
  const Matrix<double, 4, 3> basis = complement_of(z);
  points.clear();
  for (const Vector4d& q : planes) points.push_back(basis.transpose() * q);
  fit_box(points, z, config, fit);
  sum_cover(wedges, points, fit);
  scale_rows(fit);
  return fit;
}

// p is in front of one plane and behind the other iff |(q_0 + q_1) . x| < |(q_0 - q_1) . x|,
// whatever the planes: no Z is needed.
DualFit fit_edge(const Wedge& wedge, const NodeFrame& frame) {
  const Vector4d a = dual_point(wedge.planes[0], frame), b = dual_point(wedge.planes[1], frame);
  DualFit fit{};
  Vector4d::Map(fit.rows[0]) = 0.5 * (a + b);
  Vector4d::Map(fit.rows[1]) = 0.5 * (a - b);
  scale_rows(fit);
  return fit;
}

}  // namespace limn
