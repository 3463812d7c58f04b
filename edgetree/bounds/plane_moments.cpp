// Moments of planes in the frames of nodes, and the best-fitting quadric.
#include "edgetree/bounds/plane_moments.h"

#include <Eigen/Dense>

namespace limn {
namespace {

using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Matrix64 = Eigen::Matrix<double, 6, 4>;

// Regularisation of a singular matrix, as a share of its trace. Not tuned: far above rounding.
constexpr double kRidge = 1e-12;

Matrix6d with_ridge(const Matrix6d& m) { return m + Matrix6d::Identity() * (kRidge * m.trace()); }

// Rows: w n and w w in the new frame, where w becomes scale w + n . shift; columns: products of
// normals.
Eigen::Matrix<double, 4, 6> products_of_shift(const Vector3d& shift) {
  const double x = shift[0], y = shift[1], z = shift[2];
  Eigen::Matrix<double, 4, 6> rows;
  rows << x, 0, 0, 0, z, y,  //
      0, y, 0, z, 0, x,      //
      0, 0, z, y, x, 0,      //
      x * x, y * y, z * z, 2 * y * z, 2 * x * z, 2 * x * y;
  return rows;
}

}  // namespace

Matrix4d between(const NodeFrame& from, const NodeFrame& to) {
  Matrix4d change = Matrix4d::Identity();
  const Vec3d shift = (to.center - from.center) * to.inverse_radius;
  change(3, 0) = shift.x;
  change(3, 1) = shift.y;
  change(3, 2) = shift.z;
  change(3, 3) = to.inverse_radius / from.inverse_radius;
  return change;
}

void PlaneMoments::add(const Vector4d& q) {
  Six s;
  s << q[0] * q[0], q[1] * q[1], q[2] * q[2], q[1] * q[2], q[0] * q[2], q[0] * q[1];
  const Vector4d t = q * q[3];
  normals_ += s * s.transpose();
  mixed_ += s * t.transpose();
  offsets_ += t * t.transpose();
  second_ += q * q.transpose();
}

void PlaneMoments::add(const PlaneMoments& other, const NodeFrame& from, const NodeFrame& to) {
  const Matrix4d change = between(from, to);
  const double scale = change(3, 3);
  const Vector3d shift = change.row(3).head<3>();
  // (w n, w w) in the new frame is P s + D (w n, w w) in the old one.
  const Eigen::Matrix<double, 4, 6> p = products_of_shift(shift);
  Matrix4d d = Matrix4d::Identity() * scale;
  d.row(3) << 2 * scale * shift[0], 2 * scale * shift[1], 2 * scale * shift[2], scale * scale;
  const Eigen::Matrix<double, 4, 6> pa = p * other.normals_;
  const Matrix4d pbd = p * other.mixed_ * d.transpose();
  normals_ += other.normals_;
  mixed_ += pa.transpose() + other.mixed_ * d.transpose();
  offsets_ += pa * p.transpose() + pbd + pbd.transpose() + d * other.offsets_ * d.transpose();
  second_ += change * other.second_ * change.transpose();
}

Matrix4d PlaneMoments::best_quadric() const {
  const Matrix64 solved = with_ridge(normals_).ldlt().solve(mixed_);
  Matrix4d schur = offsets_ - mixed_.transpose() * solved;
  schur = (0.5 * (schur + schur.transpose())).eval();
  schur += Matrix4d::Identity() * (kRidge * (offsets_.trace() + second_.trace()));
  // 2 (Q q)_w = x . n + 2 x_3 w, x being the last four coefficients.
  Matrix4d scaled = second_;
  scaled.row(3) *= 2;
  scaled.col(3) *= 2;
  const Eigen::GeneralizedSelfAdjointEigenSolver<Matrix4d> solver(scaled, schur);
  const Vector4d x = solver.eigenvectors().col(3);
  const Six y = -solved * x;
  Matrix4d q;
  q << y[0], y[5] / 2, y[4] / 2, x[0] / 2,  //
      y[5] / 2, y[1], y[3] / 2, x[1] / 2,   //
      y[4] / 2, y[3] / 2, y[2], x[2] / 2,   //
      x[0] / 2, x[1] / 2, x[2] / 2, x[3];
  return q.allFinite() ? q : Matrix4d::Zero();
}

}  // namespace limn
