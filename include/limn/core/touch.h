#pragma once
// What the rounding of positions explains.
#include <algorithm>
#include <cmath>
#include <span>

#include "limn/core/vec.h"

namespace limn {

// The largest coordinate of points, without its sign.
inline double largest_coordinate(std::span<const Vec3d> points) {
  double largest = 0;
  for (const Vec3d& x : points)
    largest = std::max({largest, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  return largest;
}

// For points on two faces whose largest coordinates are these: a position is taken to have been
// rounded to float twice, in a file and after its transform. sqrt(3) * 2 * 2^-24 for each of two
// positions, rounded up.
inline double touch_tolerance(double size_a, double size_b) {
  return 0x1.0p-22 * (size_a + size_b);
}
// What is no longer than this many tolerances is a point: ends of overlaps are off by some.
inline constexpr double kShortestTouch = 8;

}  // namespace limn
