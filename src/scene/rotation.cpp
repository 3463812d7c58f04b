// Rodrigues' formula, its inverse and its derivative.
#include "src/scene/rotation.h"

#include <cmath>

namespace limn {
namespace {

// sin(x) / x, and (1 - cos(x)) / x^2.
double sine_over(double x) { return x == 0 ? 1 : std::sin(x) / x; }
double versine_over(double x) {
  const double half = sine_over(x / 2);
  return half * half / 2;
}

}  // namespace

Matrix4 rotation_by(const Vec3d& turn) {
  const double angle = length(turn), a = sine_over(angle), b = versine_over(angle);
  Matrix4 r;
  for (int k = 0; k < 3; ++k) {
    Vec3d unit;
    unit[k] = 1;
    const Vec3d once = cross(turn, unit), column = unit + once * a + cross(turn, once) * b;
    for (int i = 0; i < 3; ++i) r.m[i][k] = column[i];
  }
  return r;
}

// By the largest component of its quaternion (Shepperd 1978).
Vec3d rotation_vector(const Matrix4& rotation) {
  const auto& m = rotation.m;
  const double trace = m[0][0] + m[1][1] + m[2][2];
  double q[4];  // w, x, y, z
  int i = 0;
  for (int k = 1; k < 3; ++k) i = m[k][k] > m[i][i] ? k : i;
  if (trace >= m[i][i]) {
    q[0] = 1 + trace;
    for (int k = 0; k < 3; ++k)
      q[k + 1] = m[(k + 2) % 3][(k + 1) % 3] - m[(k + 1) % 3][(k + 2) % 3];
  } else {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    q[0] = m[k][j] - m[j][k];
    q[i + 1] = 1 + m[i][i] - m[j][j] - m[k][k];
    q[j + 1] = m[j][i] + m[i][j];
    q[k + 1] = m[k][i] + m[i][k];
  }
  Vec3d axis{q[1], q[2], q[3]};
  if (q[0] < 0) axis = -axis;
  const double size = length(axis);
  if (size == 0) return {};
  return axis * (2 * std::atan2(size, std::fabs(q[0])) / size);
}

Vec3d turn_per_component(const Vec3d& turn, int k) {
  const double angle = length(turn), square = angle * angle;
  // (x - sin(x)) / x^3, by its series where that is exact to rounding.
  const double rest = angle < 1e-3 ? 1.0 / 6 - square / 120 : (1 - sine_over(angle)) / square;
  Vec3d unit;
  unit[k] = 1;
  const Vec3d once = cross(turn, unit);
  return unit + once * versine_over(angle) + cross(turn, once) * rest;
}

Matrix4 transposed(const Matrix4& m) {
  Matrix4 r;
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 4; ++k) r.m[i][k] = m.m[k][i];
  }
  return r;
}

}  // namespace limn
