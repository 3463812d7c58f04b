// Fits the dual box and the pair of quadrics of a set of wedges.
#include "edgetree/quadric/quadric_node.h"

#include <Eigen/Dense>
#include <vector>

#include "edgetree/bounds/normaliser.h"

namespace limn {
namespace {

using Eigen::Matrix;
using Eigen::Matrix4d;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Converts chart points to box coordinates u = (chart point - center) / half, and writes the rows
// to the columns of the result.
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
  fit.pair = fit_pair(columns, quadric, points);
  return fit;
}

}  // namespace limn
