#pragma once
// A convex polygon as a ring of grid lines, and its subdivision.
#include <cstddef>
#include <utility>
#include <vector>

#include "src/regions/grid_line.h"

namespace limn {

// A line index, and whether the polygon is on the line's negative side.
class LineSide {
 public:
  LineSide() = default;
  LineSide(size_t line, bool negative) : bits_(static_cast<uint32_t>(line << 1 | negative)) {}
  size_t line() const { return bits_ >> 1; }
  LineSide other() const { return LineSide(line(), !(bits_ & 1)); }
  GridLine in(const std::vector<GridLine>& lines) const {
    const GridLine& l = lines[line()];
    return bits_ & 1 ? l.flipped() : l;
  }

 private:
  uint32_t bits_ = 0;
};

// The corner where the previous side ends and `side` begins, counter-clockwise. All sides have a
// positive length, and all polygons a positive area.
struct RingCorner {
  GridCorner at;
  LineSide side;
};
using Ring = std::vector<RingCorner>;

// A rectangle between axis-parallel lines of the window.
struct GridCell {
  GridPoint lower, upper;
  LineSide bottom, right, top, left;
  void to_ring(Ring& ring) const;
  // Bisects the longer side by a new line, appended to `lines`.
  std::pair<GridCell, GridCell> halves(std::vector<GridLine>& lines) const;
};
// The whole window; appends its lines.
GridCell window_cell(std::vector<GridLine>& lines);

// The side of `by` on which each corner lies: 1, -1, or 0 on the line.
struct RingSides {
  std::vector<int8_t> of;
  bool positive = false, negative = false;  // whether any lies there
};
void find_sides(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
                RingSides& sides);

// Splits a ring by `by`; both parts must have a positive area.
void cut_ring(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
              const RingSides& sides, Ring& inside, Ring& outside);

}  // namespace limn
