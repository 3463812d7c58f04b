#pragma once
// What the rounding of positions explains.

namespace limn {

// For points on two faces whose largest coordinates are these: a position is taken to have been
// rounded to float twice, in a file and after its transform. sqrt(3) * 2 * 2^-24 for each of two
// positions, rounded up.
inline double touch_tolerance(double size_a, double size_b) {
  return 0x1.0p-22 * (size_a + size_b);
}
// What is no longer than this many tolerances is a point: ends of overlaps are off by some.
inline constexpr double kShortestTouch = 8;

}  // namespace limn
