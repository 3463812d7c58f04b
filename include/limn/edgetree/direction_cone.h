#pragma once
// A convex cone of directions at a point, used to list the edges visible inside.
#include <array>
#include <cmath>

#include "limn/core/vec.h"

namespace limn {

// The directions w (of any length) with planes[i] . w >= -slack |w| for all i < count. Without
// planes: the whole sphere.
struct DirectionCone {
  static constexpr int kMostPlanes = 8;

  std::array<Vec3d, kMostPlanes> planes;  // unit normals, inward
  int count = 0;
  double slack = 0;  // sine of the outward tilt of every plane

  void add(const Vec3d& plane) { planes[count++] = plane; }
  // Clips the range [t0, t1] of the segment (1 - t) a + t b to the cone, conservatively: slightly
  // too large where the slack differs at the ends. False if nothing remains.
  bool clip(const Vec3d& a, const Vec3d& b, double& t0, double& t1) const {
    const double widen = slack * std::fmax(length(a), length(b));
    for (int i = 0; i < count; ++i) {
      if (!clip_by(dot(planes[i], a) + widen, dot(planes[i], b) + widen, t0, t1)) return false;
    }
    return true;
  }
  // Clips to where a function, linear in t with these values at a and b, is not negative.
  static bool clip_by(double at_a, double at_b, double& t0, double& t1) {
    if (at_a < 0 && at_b < 0) return false;
    if (at_a < 0) t0 = std::fmax(t0, at_a / (at_a - at_b));
    if (at_b < 0) t1 = std::fmin(t1, at_a / (at_a - at_b));
    return t0 < t1;
  }
};

}  // namespace limn
