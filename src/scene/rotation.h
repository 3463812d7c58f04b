#pragma once
// Rotations and their vectors: axis times angle [radians].
#include "limn/core/matrix.h"

namespace limn {

Matrix4 rotation_by(const Vec3d& turn);
// Of a rotation: at most a half turn.
Vec3d rotation_vector(const Matrix4& rotation);
// As component k of the vector `turn` grows, rotation_by(turn) goes on by this rotation vector per
// unit of it.
Vec3d turn_per_component(const Vec3d& turn, int k);
Matrix4 transposed(const Matrix4& m);

}  // namespace limn
