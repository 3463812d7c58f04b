// Motion of objects as linear maps, in world space and as seen from a point.
#include "edgetree/forest/forest_motion.h"

#include <Eigen/Dense>
#include <algorithm>
#include <bit>
#include <cfloat>
#include <cmath>

namespace limn {
namespace {

// A map with a larger residual, as a share of squared speeds, is not used. Not tuned.
constexpr double kLinear = 0.25;

double squares_of(const Vec3<Lanes>& v) {
  double sum = 0;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < kLanes; ++i) sum += v[k][i] * v[k][i];
  return sum;
}

// The linear part: the least-squares map of least norm, since flat and straight objects do not
// determine it in all directions. Rounding of positions gives them a small thickness.
void fit_linear(const EdgeMesh& mesh, const Lanes& lane_scale, ObjectMotion& motion) {
  Eigen::Matrix3d squares = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 3 * kLanes> products = Eigen::Matrix<double, 3, 3 * kLanes>::Zero();
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3d d = mesh.positions[v] - motion.center;
    const Vec3<Lanes> u = scaled_velocity(mesh.tangents[v], lane_scale) - motion.at_center;
    const Eigen::Vector3d x(d.x, d.y, d.z);
    squares += x * x.transpose();
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < kLanes; ++i) products.col(kLanes * k + i) += x * u[k][i];
  }
  // Thin means within four roundings of the farthest position (2^-24 each).
  const double rounding = 0x1p-22 * mesh.extent;
  Eigen::CompleteOrthogonalDecomposition<Eigen::Matrix3d> decomposition;
  const double explained = static_cast<double>(mesh.positions.size()) * rounding * rounding;
  if (!(squares.trace() > explained)) return;
  decomposition.setThreshold(std::max(explained / squares.trace(), 1e-12));
  const Eigen::Matrix<double, 3, 3 * kLanes> linear =
      decomposition.compute(squares).solve(products);
  for (int column = 0; column < 3; ++column)
    for (int k = 0; k < 3; ++k)
      for (int i = 0; i < kLanes; ++i) motion.linear[column][k][i] = linear(column, kLanes * k + i);
}

}  // namespace

Vec3<Lanes> scaled_velocity(const Vec3<Lanes>& v, const Lanes& lane_scale) {
  Vec3<Lanes> result;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < kLanes; ++i) result[k][i] = v[k][i] * lane_scale[i];
  return result;
}

double sum_of_speeds(const Vec3<Lanes>& v) {
  double sum = 0;
  for (int i = 0; i < kLanes; ++i)
    sum += std::sqrt(v.x[i] * v.x[i] + v.y[i] * v.y[i] + v.z[i] * v.z[i]);
  return sum;
}

ObjectMotion motion_of(const EdgeMesh& mesh, const Lanes& lane_scale) {
  ObjectMotion motion;
  if (mesh.tangents.empty() || mesh.positions.empty()) return motion;
  const double share = 1 / static_cast<double>(mesh.positions.size());
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    motion.center = motion.center + mesh.positions[v] * share;
    motion.at_center = motion.at_center + scaled_velocity(mesh.tangents[v], lane_scale) * share;
  }
  fit_linear(mesh, lane_scale, motion);
  double left = 0, all = 0;
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3<Lanes> u = scaled_velocity(mesh.tangents[v], lane_scale);
    all += squares_of(u);
    left += squares_of(u - motion.velocity(mesh.positions[v]));
  }
  return left <= kLinear * all ? motion : ObjectMotion{};
}

ViewerMotion::ViewerMotion(const EdgeQuery& query, const Lanes& lane_scale, double unit)
    : p(query.p), inverse_unit(1 / unit), velocity(scaled_velocity(query.velocity, lane_scale)) {
  const DirectionTurn turn{scaled_velocity(query.turn.rate, lane_scale), query.turn.axis};
  for (int column = 0; column < 3; ++column) {
    Vec3d axis{};
    axis[column] = inverse_unit;
    linear[column] = turn.velocity(axis);
  }
}

SeenMotion::SeenMotion(const ObjectMotion& object, const ViewerMotion& viewer) {
  const Vec3<Lanes> there = object.velocity(viewer.p), at_p = there - viewer.velocity;
  Vec3<Lanes> linear[3];
  for (int column = 0; column < 3; ++column)
    linear[column] = object.linear[column] * viewer.inverse_unit - viewer.linear[column];
  for (int i = 0; i < kLanes; ++i) {
    double columns2[3] = {0, 0, 0}, largest = 0;
    for (int k = 0; k < 3; ++k) {
      // The sum of both moduli, since both are rounded.
      largest += std::fabs(viewer.velocity[k][i]) + std::fabs(there[k][i]);
      for (int column = 0; column < 3; ++column)
        columns2[column] += linear[column][k][i] * linear[column][k][i];
    }
    largest += std::sqrt(columns2[0] + columns2[1] + columns2[2]);
    if (!(largest >= FLT_MIN)) continue;
    // The largest power of two below it.
    const double size =
        std::bit_cast<double>(std::bit_cast<uint64_t>(largest) & (uint64_t{0x7ff} << 52));
    const double inverse = 1 / size;
    Lane& lane = lanes[count++];
    lane.size = static_cast<float>(size);
    for (int k = 0; k < 3; ++k) {
      lane.column2[k] = static_cast<float>(columns2[k] * inverse * inverse);
      lane.at_p[k] = static_cast<float>(at_p[k][i] * inverse);
      for (int column = 0; column < 3; ++column)
        lane.linear[k][column] = static_cast<float>(linear[column][k][i] * inverse);
    }
  }
}

}  // namespace limn
