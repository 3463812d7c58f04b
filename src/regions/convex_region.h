#pragma once
// A convex polygon as a ring of lines on a grid, cut by further lines.
#include <cstddef>
#include <utility>
#include <vector>

#include "src/regions/grid_line.h"

namespace limn {

// A line's number and whether the polygon lies on its negative side.
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

// Where the side before ends and `side` begins, counter-clockwise. No side is a point: every
// polygon has an area.
struct RingCorner {
  GridCorner at;
  LineSide side;
};
using Ring = std::vector<RingCorner>;

// A part of the window between lines along its axes.
struct GridCell {
  GridPoint lower, upper;
  LineSide bottom, right, top, left;
  void to_ring(Ring& ring) const;
  // Cut in the middle, across its longer side, by a line that is appended.
  std::pair<GridCell, GridCell> halves(std::vector<GridLine>& lines) const;
};
// The whole window, of lines that are appended.
GridCell window_cell(std::vector<GridLine>& lines);

// On which side of `by` each corner lies: 1, -1, or 0 on it.
struct RingSides {
  std::vector<int8_t> of;
  bool positive = false, negative = false;  // whether any lies there
};
void find_sides(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
                RingSides& sides);

// The parts of a ring on either side of `by`, of which both must have an area.
void cut_ring(const std::vector<GridLine>& lines, const Ring& ring, LineSide by,
              const RingSides& sides, Ring& inside, Ring& outside);

}  // namespace limn
