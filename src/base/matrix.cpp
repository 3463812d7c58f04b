// Products and inverses of 4x4 matrices.
#include "limn/core/matrix.h"

#include <cmath>
#include <stdexcept>
#include <utility>

namespace limn {

namespace {

Vec3d column(const Matrix4& a, int c) { return {a.m[0][c], a.m[1][c], a.m[2][c]}; }

}  // namespace

Vec3d Matrix4::point(const Vec3d& p) const {
  double r[4];
  for (int i = 0; i < 4; ++i) r[i] = m[i][0] * p.x + m[i][1] * p.y + m[i][2] * p.z + m[i][3];
  const Vec3d affine{r[0], r[1], r[2]};
  return r[3] == 1 ? affine : affine / r[3];
}

Vec3d Matrix4::vector(const Vec3d& v) const {
  return column(*this, 0) * v.x + column(*this, 1) * v.y + column(*this, 2) * v.z;
}

// The inverse transpose of [a b c] is [b x c, c x a, a x b] / det(a, b, c).
Vec3d Matrix4::normal(const Vec3d& n) const {
  const Vec3d a = column(*this, 0), b = column(*this, 1), c = column(*this, 2);
  const Vec3d r = cross(b, c) * n.x + cross(c, a) * n.y + cross(a, b) * n.z;
  return r / determinant(a, b, c);
}

// Gauss-Jordan elimination with row pivoting. A pivot within rounding error of zero, relative to
// the entries of its column, means a singular matrix, at any scale.
Matrix4 Matrix4::inverse() const {
  Matrix4 a = *this, r;
  double column_scale[4] = {};
  for (int c = 0; c < 4; ++c) {
    for (int i = 0; i < 4; ++i) column_scale[c] = std::fmax(column_scale[c], std::fabs(m[i][c]));
  }
  for (int c = 0; c < 4; ++c) {
    int pivot = c;
    for (int i = c + 1; i < 4; ++i) {
      if (std::fabs(a.m[i][c]) > std::fabs(a.m[pivot][c])) pivot = i;
    }
    if (!(std::fabs(a.m[pivot][c]) > 0x1p-49 * column_scale[c])) {
      throw std::domain_error("matrix is not invertible");
    }
    std::swap(a.m[c], a.m[pivot]);
    std::swap(r.m[c], r.m[pivot]);
    const double scale = 1 / a.m[c][c];
    for (int j = 0; j < 4; ++j) {
      a.m[c][j] *= scale;
      r.m[c][j] *= scale;
    }
    for (int i = 0; i < 4; ++i) {
      if (i == c) continue;
      const double factor = a.m[i][c];
      for (int j = 0; j < 4; ++j) {
        a.m[i][j] -= factor * a.m[c][j];
        r.m[i][j] -= factor * r.m[c][j];
      }
    }
  }
  return r;
}

Matrix4 operator*(const Matrix4& a, const Matrix4& b) {
  Matrix4 r;
  for (int i = 0; i < 4; ++i) {
    for (int j = 0; j < 4; ++j) {
      r.m[i][j] = 0;
      for (int k = 0; k < 4; ++k) r.m[i][j] += a.m[i][k] * b.m[k][j];
    }
  }
  return r;
}

}  // namespace limn
