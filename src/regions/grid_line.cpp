// Exact signs for lines on a grid: a 3 by 3 determinant in 128-bit integers, behind a filter in
// doubles.
#include "src/regions/grid_line.h"

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

}  // namespace

GridCorner meet(const GridLine& l, const GridLine& m) {
  const Meeting p = exact_meeting(l, m);
  const auto w = static_cast<double>(p.w);
  return {static_cast<double>(p.x) / w, static_cast<double>(p.y) / w};
}

int exact_side(const GridLine& line, const GridLine& l, const GridLine& m) {
  const Meeting p = exact_meeting(l, m);
  // Corners of regions lie in the window, so x and y are below 2^93, each product below 2^125.
  const Wide value = line.a * p.x + line.b * p.y + line.c * p.w;
  return value > 0 ? 1 : value < 0 ? -1 : 0;
}

}  // namespace limn
