#pragma once
// Lines through grid points, and the exact side of an intersection relative to a third line.
#include <cmath>
#include <cstdint>

namespace limn {

// A window is 2^30 grid steps wide, its center at (0, 0). Points on lines lie at most twice as far
// out as its sides.
inline constexpr double kGridHalf = 0x1p29;
inline constexpr double kGridBand = 0x1p30;

struct GridPoint {
  int64_t x, y;  // |x|, |y| <= 2^30
  bool operator==(const GridPoint&) const = default;
};

// The half-plane a x + b y + c >= 0; |a|, |b| <= 2^31, |c| <= 2^62.
struct GridLine {
  int64_t a, b, c;
  GridLine flipped() const { return {-a, -b, -c}; }
  bool operator==(const GridLine&) const = default;
};

// The half-plane to the left of the line from p to q, two distinct points.
inline GridLine line_through(const GridPoint& p, const GridPoint& q) {
  const int64_t a = p.y - q.y, b = q.x - p.x;
  return {a, b, -(a * p.x + b * p.y)};
}

// Twice the signed area of a triangle, positive if it is counter-clockwise.
inline int64_t twice_area(const GridPoint& p, const GridPoint& q, const GridPoint& r) {
  return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
}

struct GridCorner {
  double x, y;  // exact to three roundings each
};
// The intersection of two lines that are not parallel.
GridCorner meet(const GridLine& l, const GridLine& m);

// The exact side of `line` on which the boundary of l turns left into that of m, within the window:
// 1, -1, or 0 on the line.
int exact_side(const GridLine& line, const GridLine& l, const GridLine& m);

// A floating-point filter for exact_side; 0 if it cannot decide. Coordinates carry three roundings,
// c one, each product and sum another: at most seven of 2^-53 per summand.
class SideFilter {
 public:
  SideFilter() = default;
  explicit SideFilter(const GridLine& line)
      : a_(static_cast<double>(line.a)),
        b_(static_cast<double>(line.b)),
        c_(static_cast<double>(line.c)) {}
  // Branch-free: branches would be mispredicted half of the time.
  int side_of(const GridCorner& corner) const {
    const double ax = a_ * corner.x, by = b_ * corner.y, value = ax + by + c_;
    const double error = 0x1.0p-50 * (std::fabs(ax) + std::fabs(by) + std::fabs(c_));
    return static_cast<int>(value > error) - static_cast<int>(value < -error);
  }
  // The corner of a box that is farthest towards the negative side.
  GridCorner rearmost(const GridCorner& lower, const GridCorner& upper) const {
    return {a_ > 0 ? lower.x : upper.x, b_ > 0 ? lower.y : upper.y};
  }

 private:
  double a_, b_, c_;
};

}  // namespace limn
