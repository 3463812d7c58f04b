#pragma once
// 4x4 transforms of scene files.
#include "limn/core/vec.h"

namespace limn {

// Row-major affine or projective 4x4 matrix, acting on column vectors.
struct Matrix4 {
  double m[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  Vec3d point(const Vec3d& p) const;
  Vec3d vector(const Vec3d& v) const;
  // Transforms a normal by the inverse transpose, without normalisation. Requires an inverse.
  Vec3d normal(const Vec3d& n) const;
  Matrix4 inverse() const;  // throws std::domain_error if singular
  friend Matrix4 operator*(const Matrix4& a, const Matrix4& b);
};

}  // namespace limn
