#pragma once
// Tangents of a shading frame.
#include "limn/core/dual.h"

namespace limn {

// The unit vector along a tangent of any length, made orthogonal to the unit normal n; where it has
// no direction along the surface (the poles of a sphere), some frame's.
template <class S>
Vec3<S> along_surface(const Vec3<S>& n, const Vec3<S>& tangent) {
  const Vec3<S> s = tangent - n * dot(n, tangent);
  if (value(length_squared(s)) > 0x1p-80 * value(length_squared(tangent))) return normalize(s);
  const Vec3d some = Frame(value(n)).s;
  return normalize(Vec3<S>{some.x, some.y, some.z} - n * dot(n, some));
}

}  // namespace limn
