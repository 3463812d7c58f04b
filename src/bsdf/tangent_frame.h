#pragma once
// Tangents of a shading frame.
#include <cmath>

#include "limn/core/dual.h"

namespace limn {

// The unit vector along a tangent of any length, made orthogonal to the unit normal n; where it has
// no direction along the surface (the poles of a sphere, uv without extent), some frame's, which
// jumps where n.z changes its sign.
template <class S>
Vec3<S> along_surface(const Vec3<S>& n, const Vec3<S>& tangent) {
  const Vec3<S> s = tangent - n * dot(n, tangent);
  if (value(length_squared(s)) > 0x1p-80 * value(length_squared(tangent))) return normalize(s);
  const double sign = std::copysign(1.0, value(n.z));  // FrameOf's s
  const S a = -1.0 / (n.z + sign);
  return {1.0 + n.x * n.x * a * sign, n.x * n.y * a * sign, n.x * -sign};
}

}  // namespace limn
