#pragma once
// Lines through points of a grid, and on which side of one two others meet: exactly.
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
};

// What lies to the left of the way from p to q, two different points.
inline GridLine line_through(const GridPoint& p, const GridPoint& q) {
  const int64_t a = p.y - q.y, b = q.x - p.x;
  return {a, b, -(a * p.x + b * p.y)};
}

// Twice the signed area of a triangle, positive if it is counter-clockwise.
inline int64_t twice_area(const GridPoint& p, const GridPoint& q, const GridPoint& r) {
  return (q.x - p.x) * (r.y - p.y) - (q.y - p.y) * (r.x - p.x);
}

struct GridCorner {
  double x, y;  // to three roundings each
};
// Where two lines meet that are not parallel.
GridCorner meet(const GridLine& l, const GridLine& m);

// The side of `line` on which the border of l turns left into that of m: 1, -1, or 0 if it is on
// it. `corner`: meet(l, m).
int side_of_corner(const GridLine& line, const GridCorner& corner, const GridLine& l,
                   const GridLine& m);

}  // namespace limn
