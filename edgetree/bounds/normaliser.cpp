// The hyperplane onto which the planes of a node are projected, from normals alone, from the
// planes' hull or by a linear program.
#include "edgetree/bounds/normaliser.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

namespace limn {
namespace {

using Eigen::Matrix;
using Eigen::Vector3d;
using Eigen::Vector4d;

// Chart points have the relative error 2^-52 / (Z . q). For smaller Z . q it could exceed a float's
// rounding, which the bound of queries must cover.
constexpr double kMinSeparation = 0x1.0p-20;

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

// The direction with approximately the smallest maximum angle to all normals: the center of their
// smallest enclosing ball, by the iteration of Badoiu and Clarkson.
Vector4d central_direction(const std::vector<Vector4d>& points) {
  Vector3d mean = Vector3d::Zero();
  for (const Vector4d& q : points) mean += q.head<3>();
  Vector3d center = mean / static_cast<double>(points.size());
  constexpr int kSteps = 12;  // not tuned
  for (int i = 2; i < 2 + kSteps && points.size() > 2; ++i) {
    // The farthest unit normal has the smallest product with the center.
    const Farthest far = least_product(points, Vector4d(center[0], center[1], center[2], 0));
    center += (points[far.index].head<3>() - center) / i;
  }
  const double norm = center.norm();
  if (norm == 0) return Vector4d::Zero();
  return Vector4d(center[0], center[1], center[2], 0) / norm;
}

// Up to five points with weights of a convex combination.
struct Hull {
  static constexpr int kMost = 5;  // as many as four dimensions need
  Vector4d points[kMost];
  double weights[kMost];
  int count = 0;

  Vector4d mean() const {
    Vector4d sum = Vector4d::Zero();
    for (int i = 0; i < count; ++i) sum += weights[i] * points[i];
    return sum;
  }
  // Weights (of any sign) of the affine combination of least norm, in proportion to the solution of
  // (Q^T Q + 1) w = 1. Gaussian elimination: the matrix is positive definite.
  void shortest(double (&w)[kMost]) const {
    double rows[kMost][kMost + 1];
    for (int i = 0; i < count; ++i) {
      for (int k = 0; k < count; ++k) rows[i][k] = points[i].dot(points[k]) + 1;
      rows[i][count] = 1;
    }
    for (int i = 0; i < count; ++i)
      for (int k = i + 1; k < count; ++k)
        for (int j = count; j >= i; --j) rows[k][j] -= rows[k][i] / rows[i][i] * rows[i][j];
    double sum = 0;
    for (int i = count - 1; i >= 0; --i) {
      w[i] = rows[i][count];
      for (int k = i + 1; k < count; ++k) w[i] -= rows[i][k] * w[k];
      w[i] /= rows[i][i];
      sum += w[i];
    }
    for (int i = 0; i < count; ++i) w[i] /= sum;
  }
  // Moves towards the point of least norm until it is reached or a weight becomes zero; removes
  // that point and returns true.
  bool shorten() {
    double target[kMost];
    shortest(target);
    double part = 1;
    int out = -1;
    for (int i = 0; i < count; ++i) {
      if (target[i] > 0) continue;
      const double limit = weights[i] / (weights[i] - target[i]);
      if (out < 0 || limit < part) {
        part = limit;
        out = i;
      }
    }
    for (int i = 0; i < count; ++i) weights[i] += part * (target[i] - weights[i]);
    if (out < 0) return false;
    --count;
    points[out] = points[count];
    weights[out] = weights[count];
    return true;
  }
};

// Wolfe's algorithm for the point of least norm in a convex hull: the normal of the hyperplane
// through the origin that is farthest from all points. Zero if a convex combination of the points
// is shorter than half of kMinSeparation: then no unit Z has that product with all of them (half of
// it is far beyond rounding). It may give up without an answer; the linear programs then find one
// more slowly.
std::optional<Vector4d> nearest_of_hull(const std::vector<Vector4d>& points) {
  constexpr int kSteps = 32;  // not tuned
  Hull hull;
  hull.points[hull.count++] = points[0];
  hull.weights[0] = 1;
  for (int step = 0; step < kSteps; ++step) {
    const Vector4d mean = hull.mean();
    const double norm = mean.norm();
    if (norm < 0.5 * kMinSeparation) return Vector4d::Zero();
    const Farthest least = least_product(points, mean);
    // Any valid Z suffices: nearly optimal is enough.
    if (least.value > 0.5 * norm * norm) return mean / norm;
    if (hull.count == Hull::kMost) return {};
    hull.points[hull.count] = points[least.index];
    hull.weights[hull.count++] = 0;
    while (hull.count > 1 && hull.shorten()) {
    }
  }
  return {};
}

// Solves the linear program by adding the most violated constraints until none is left.
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
    // Any valid Z suffices: nearly optimal is enough.
    if (least.value > 0.5 * rho || round == kRounds) return z / z.norm();
    active.push_back(points[least.index]);
  }
}

}  // namespace

Vector4d normaliser_of(const std::vector<Vector4d>& points) {
  Vector4d z = central_direction(points);
  const double least = z.norm() > 0 ? least_product(points, z).value : 0;
  // Below this, the chart would be five times larger than necessary. Not tuned.
  constexpr double kWide = 0.2;
  if (least >= kWide) return z;
  const std::optional<Vector4d> nearest = nearest_of_hull(points);
  const Vector4d other = nearest ? *nearest : farthest_hyperplane(points);
  const double other_least = other.norm() > 0 ? least_product(points, other).value : 0;
  if (std::max(least, other_least) < kMinSeparation) return Vector4d::Zero();
  return least >= other_least ? z : other;
}

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

}  // namespace limn
