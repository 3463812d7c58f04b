#pragma once
// Tolerances that account for the rounding of vertex positions.
#include <algorithm>
#include <cmath>
#include <span>

#include "limn/core/vec.h"

namespace limn {

// The largest absolute coordinate of the points.
inline double largest_coordinate(std::span<const Vec3d> points) {
  double largest = 0;
  for (const Vec3d& x : points)
    largest = std::max({largest, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  return largest;
}

// Distance that rounding explains between points on two faces of these largest coordinates. Each
// position is rounded to float twice, in the file and after its transform. The value is sqrt(3) * 2
// * 2^-24 for each of two positions, rounded up.
inline double touch_tolerance(double size_a, double size_b) {
  return 0x1.0p-22 * (size_a + size_b);
}
// Overlaps no longer than this many tolerances count as points, as their ends are inexact.
inline constexpr double kShortestTouch = 8;

}  // namespace limn
