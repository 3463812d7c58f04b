// Cutting rings of lines: new corners are named by their lines, so nothing is ever rounded.
#include "src/regions/convex_region.h"

#include <array>

namespace limn {

void make_window_ring(std::vector<GridLine>& lines, Ring& ring) {
  constexpr auto kHalf = static_cast<int64_t>(kGridHalf);
  const std::array<GridPoint, 4> corners = {
      {{-kHalf, -kHalf}, {kHalf, -kHalf}, {kHalf, kHalf}, {-kHalf, kHalf}}};
  ring.clear();
  for (size_t k = 0; k < 4; ++k) {
    const GridPoint& p = corners[k];
    ring.push_back(
        {{static_cast<double>(p.x), static_cast<double>(p.y)}, LineSide(lines.size(), false)});
    lines.push_back(line_through(p, corners[(k + 1) % 4]));
  }
}

void find_sides(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
                RingSides& sides) {
  const GridLine line = by.in(lines);
  sides.of.clear();
  sides.positive = sides.negative = false;
  LineSide before = ring.back().side;
  for (const RingCorner& corner : ring) {
    const int s = side_of_corner(line, corner.at, before.in(lines), corner.side.in(lines));
    sides.of.push_back(static_cast<int8_t>(s));
    sides.positive = sides.positive || s > 0;
    sides.negative = sides.negative || s < 0;
    before = corner.side;
  }
}

namespace {

// The part on the side of sign `sign`, whose new side is `closing`.
void take_part(const std::vector<GridLine>& lines, const Ring& ring, LineSide closing,
               const RingSides& sides, int sign, Ring& part) {
  part.clear();
  const size_t n = ring.size();
  for (size_t i = 0; i < n; ++i) {
    const int here = sides.of[i] * sign, next = sides.of[(i + 1) % n] * sign;
    if (here <= 0 && next <= 0) continue;
    const RingCorner& corner = ring[i];
    const auto crossing = [&] { return meet(corner.side.in(lines), closing.in(lines)); };
    part.push_back({here < 0 ? crossing() : corner.at, corner.side});
    if (next < 0) part.push_back({crossing(), closing});
    if (next == 0) part.push_back({ring[(i + 1) % n].at, closing});
  }
}

}  // namespace

void cut_ring(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
              const RingSides& sides, Ring& inside, Ring& outside) {
  take_part(lines, ring, by, sides, 1, inside);
  take_part(lines, ring, by.other(), sides, -1, outside);
}

}  // namespace limn
