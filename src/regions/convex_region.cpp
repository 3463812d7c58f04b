// Splits rings of lines. New corners are represented by their lines, so nothing is rounded.
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

void GridCell::to_ring(Ring& ring) const {
  const auto corner = [](int64_t x, int64_t y) {
    return GridCorner{static_cast<double>(x), static_cast<double>(y)};
  };
  ring.clear();
  ring.push_back({corner(lower.x, lower.y), bottom});
  ring.push_back({corner(upper.x, lower.y), right});
  ring.push_back({corner(upper.x, upper.y), top});
  ring.push_back({corner(lower.x, upper.y), left});
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
  const size_t n = ring.size();
  sides.of.resize(n);
  int positive = 0, negative = 0;
  for (size_t i = 0; i < n; ++i) {
    const int s = filter.side_of(ring[i].at);
    sides.of[i] = static_cast<int8_t>(s);
    positive += s > 0;
    negative += s < 0;
  }
  if (static_cast<size_t>(positive) + negative < n) {
    for (size_t i = 0; i < n; ++i) {
      if (sides.of[i] != 0) continue;
      const LineSide before = ring[i == 0 ? n - 1 : i - 1].side;
      const int s = exact_side(line, before.in(lines), ring[i].side.in(lines));
      sides.of[i] = static_cast<int8_t>(s);
      positive += s > 0;
      negative += s < 0;
    }
  }
  sides.positive = positive > 0;
  sides.negative = negative > 0;
}

void cut_ring(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
              const RingSides& sides, Ring& inside, Ring& outside) {
  inside.clear();
  outside.clear();
  const GridLine line = by.in(lines);
  const size_t n = ring.size();
  for (size_t i = 0; i < n; ++i) {
    const RingCorner& corner = ring[i];
    const RingCorner& after = ring[i + 1 < n ? i + 1 : 0];
    const int here = sides.of[i], next = sides.of[i + 1 < n ? i + 1 : 0];
    if (here * next < 0) {
      // The ring before the crossing ends there with a new side; the other ring begins there.
      const GridCorner crossing = meet(corner.side.in(lines), line);
      Ring& ends = here > 0 ? inside : outside;
      Ring& begins = here > 0 ? outside : inside;
      ends.push_back(corner);
      ends.push_back({crossing, here > 0 ? by : by.other()});
      begins.push_back({crossing, corner.side});
    } else if (here != 0 || next != 0) {
      Ring& part = here + next > 0 ? inside : outside;
      part.push_back(corner);
      if (next == 0) part.push_back({after.at, here > 0 ? by : by.other()});
    }
  }
}

}  // namespace limn
