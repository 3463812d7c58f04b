// The dual box of a set of edges: normaliser, axes, rows.
#include "edgetree/bounds/forest_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

#include "edgetree/bounds/normaliser.h"
#include "edgetree/bounds/pair_fit.h"

// A plane is q = (n, signed distance of the frame's center / radius), so that q . x is the signed
// distance of p / radius. Division by Z . q > 0 projects all planes to the hyperplane Z . q = 1, an
// affine 3-space (the chart), where a wedge is the segment between the planes of its faces. Chart
// points are Z + t_1 r_1 + t_2 r_2 + t_3 r_3 with an orthonormal basis (t_1, t_2, t_3, Z). A box r
// = c + sum of e_k u_k a_k, |u_k| <= 1, with axes a_k, becomes in R^4:
// row_0 = Z + sum of c_i t_i,   row_k = e_k sum of a_k,i t_i.

namespace limn {
namespace {

using Eigen::Matrix;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Weight of flat edges, for points on their plane. Not tuned.
constexpr double kFlat = 0x1.0p-12;

struct Scratch {
  std::vector<Vector4d> planes;
  std::vector<Vector3d> points;
};

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
  constexpr size_t kMany = 4096;  // wedges, whose memory is not kept; not tuned
  static thread_local Scratch kept;
  Scratch own;
  auto& [planes, points] = wedges.size() > kMany ? own : kept;
  planes.clear();
  planes.reserve(2 * wedges.size());
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
  points.reserve(planes.size());
  for (const Vector4d& q : planes) points.push_back(basis.transpose() * q);
  fit_box(points, z, config, fit);
  sum_cover(wedges, points, fit);
  scale_rows(fit);
  return fit;
}

// p is between the planes iff |(q_0 + q_1) . x| < |(q_0 - q_1) . x|, for any planes: Z is not
// needed.
DualFit fit_edge(const Wedge& wedge, const NodeFrame& frame) {
  const Vector4d a = dual_point(wedge.planes[0], frame), b = dual_point(wedge.planes[1], frame);
  DualFit fit{};
  Vector4d::Map(fit.rows[0]) = 0.5 * (a + b);
  Vector4d::Map(fit.rows[1]) = 0.5 * (a - b);
  scale_rows(fit);
  return fit;
}

}  // namespace limn
