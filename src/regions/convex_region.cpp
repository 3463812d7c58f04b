// Cutting rings of lines: new corners are named by their lines, so nothing is ever rounded.
#include "src/regions/convex_region.h"

#include <array>

namespace limn {

GridCell window_cell(std::vector<GridLine>& lines) {
  constexpr auto kHalf = static_cast<int64_t>(kGridHalf);
  const std::array<GridPoint, 4> corners = {
      {{-kHalf, -kHalf}, {kHalf, -kHalf}, {kHalf, kHalf}, {-kHalf, kHalf}}};
  const size_t first = lines.size();
  for (size_t k = 0; k < 4; ++k) lines.push_back(line_through(corners[k], corners[(k + 1) % 4]));
  const auto side = [&](size_t k) { return LineSide(first + k, false); };
  return {corners[0], corners[2], side(0), side(1), side(2), side(3)};
}

Ring GridCell::ring() const {
  const auto corner = [](int64_t x, int64_t y) {
    return GridCorner{static_cast<double>(x), static_cast<double>(y)};
  };
  return {{corner(lower.x, lower.y), bottom},
          {corner(upper.x, lower.y), right},
          {corner(upper.x, upper.y), top},
          {corner(lower.x, upper.y), left}};
}

std::pair<GridCell, GridCell> GridCell::halves(std::vector<GridLine>& lines) const {
  const size_t line = lines.size();
  GridCell low = *this, high = *this;
  if (upper.x - lower.x >= upper.y - lower.y) {
    const int64_t middle = (lower.x + upper.x) / 2;
    lines.push_back(line_through({middle, lower.y}, {middle, upper.y}));
    low.upper.x = high.lower.x = middle;
    low.right = LineSide(line, false);
    high.left = LineSide(line, true);
  } else {
    const int64_t middle = (lower.y + upper.y) / 2;
    lines.push_back(line_through({lower.x, middle}, {upper.x, middle}));
    low.upper.y = high.lower.y = middle;
    low.top = LineSide(line, true);
    high.bottom = LineSide(line, false);
  }
  return {low, high};
}

void find_sides(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
                RingSides& sides) {
  const GridLine line = by.in(lines);
  const SideFilter filter(line);
  sides.of.clear();
  sides.positive = sides.negative = false;
  LineSide before = ring.back().side;
  for (const RingCorner& corner : ring) {
    int s = filter.side_of(corner.at);
    if (s == 0) s = exact_side(line, before.in(lines), corner.side.in(lines));
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
