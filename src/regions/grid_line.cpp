// Exact signs for lines on a grid: a 3 by 3 determinant in 128-bit integers, behind a filter in
// doubles.
#include "src/regions/grid_line.h"

#include <cmath>

namespace limn {
namespace {

using Wide = __int128;

// The point where two lines meet, in homogeneous coordinates: |x|, |y| < 2^95, |w| <= 2^63.
struct Meeting {
  Wide x, y, w;
};
Meeting exact_meeting(const GridLine& l, const GridLine& m) {
  return {Wide(l.b) * m.c - Wide(m.b) * l.c, Wide(l.c) * m.a - Wide(m.c) * l.a,
          Wide(l.a) * m.b - Wide(m.a) * l.b};
}

int exact_side(const GridLine& line, const GridLine& l, const GridLine& m) {
  const Meeting p = exact_meeting(l, m);
  // Corners of regions lie in the window, so x and y are below 2^93, each product below 2^125.
  const Wide value = line.a * p.x + line.b * p.y + line.c * p.w;
  return value > 0 ? 1 : value < 0 ? -1 : 0;
}

}  // namespace

GridCorner meet(const GridLine& l, const GridLine& m) {
  const Meeting p = exact_meeting(l, m);
  const auto w = static_cast<double>(p.w);
  return {static_cast<double>(p.x) / w, static_cast<double>(p.y) / w};
}

// Each coordinate carries three roundings, c one, each product and each sum another: at most seven
// of 2^-53 on each summand.
int side_of_corner(const GridLine& line, const GridCorner& corner, const GridLine& l,
                   const GridLine& m) {
  const double ax = static_cast<double>(line.a) * corner.x;
  const double by = static_cast<double>(line.b) * corner.y;
  const auto c = static_cast<double>(line.c);
  const double value = ax + by + c;
  const double error = 0x1.0p-50 * (std::fabs(ax) + std::fabs(by) + std::fabs(c));
  if (value > error) return 1;
  if (value < -error) return -1;
  return exact_side(line, l, m);
}

}  // namespace limn
