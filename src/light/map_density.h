#pragma once
// The density by which directions are drawn from a radiance map: few numbers, so that they stay in
// the caches while the texels of a large map do not.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "src/base/huge_pages.h"
#include "src/base/wide.h"

namespace limn {

// Over a map of W by H texels: a point (x, y) lies x columns to the right of the center of column
// 0, 0 <= x < W (wrapped), and y rows below the center of row 0, 0 <= y <= H - 1; rows are equally
// spaced in the polar angle theta, from 0 to pi. The density is one in solid angle.
//
// A quadtree over the cells between texels. A leaf is a square of 1 to 64 cells on a side (cut at
// the border), drawn in proportion to the integral of the importance; within it the density is
// bilinear in azimuth and cos(theta) through the importances at its corners, each mixed with a
// little of the mean (where one side of a cell is black, radiance falls to zero with theta but the
// density with cos(theta), and near a pole their ratio would grow without bound). Squares are as
// large as the importance still follows that: a smooth sky of half a million cells has some
// thousand leaves. The density is positive wherever the importance, bilinear between texels, is.
//
// A draw chooses a block of 64 by 64 cells, then a leaf there, each by an alias table: what is
// bright is read often and stays at hand, while one table of all leaves would be read anywhere.
class MapDensity {
 public:
  // importance: height by width, finite, not negative, one at least positive; height at least 2.
  MapDensity(int width, int height, std::span<const float> importance);

  // Of eight draws at once: a draw is a chain of reads, roots and divisions, most of which one
  // alone would wait for.
  struct Drawn {
    wide::Doubles x, cos_theta, pdf;  // pdf [1/sr]
  };
  // From two numbers in [0, 1) for each.
  Drawn sample(const wide::Doubles& u1, const wide::Doubles& u2) const;
  // column, row: the cell of (x, y). cos_theta: that of y. [1/sr]
  double pdf(int column, int row, double x, double cos_theta) const;
  // Asks for what `pdf` reads of that cell.
  void fetch(int column, int row) const {
    __builtin_prefetch(&leaf(square(column, row), column, row));
  }

  size_t leaf_count() const { return leaves_.size(); }

 private:
  static constexpr int kGridLog = 3;     // the grid's squares: the smallest whose leaves may differ
  static constexpr int kLargestLog = 6;  // the largest leaf. Both not tuned

  using Corners = std::array<uint8_t, 4>;  // top left, top right, bottom left, bottom right

  // One of as many equally likely slots as there are items: its first `share` belongs to the item
  // of the slot's own index, the rest to `alias`.
  struct Slot {
    float share = 1;
    uint32_t alias = 0;
  };
  // All that a draw reads of it, in one line of a cache mostly.
  struct Leaf {
    float scale;      // of `corners`, to the density before it is normalised
    Corners corners;  // at least 1
    uint32_t column;  // of its first cell
    uint32_t row : 28;
    uint32_t log : 4;  // of its side
    Slot slot;         // of as many as its block has leaves; `alias` counts from the block's first
  };
  // The leaves of a block follow each other.
  struct Block {
    uint32_t first, count;
  };
  // A square of the grid: where its leaves begin, and the logarithm of their side. A leaf larger
  // than the square is shared by all squares that it covers.
  struct Square {
    uint32_t first : 28;
    uint32_t log : 4;
  };
  // What a leaf covers: cells [x0, x1) by [y0, y1).
  struct Patch {
    int x0, y0, x1, y1;
  };

  Patch patch(int column, int row, int log) const;
  const Square& square(int column, int row) const {
    return grid_[static_cast<size_t>(row >> kGridLog) * grid_width_ + (column >> kGridLog)];
  }
  const Leaf& leaf(const Square& square, int column, int row) const;
  double solid_angle(const Leaf& leaf) const;  // [sr]
  double mass(const Leaf& leaf) const;         // its integral, before it is normalised
  void build_aliases();
  static std::vector<Slot> make_slots(std::span<const double> weights, double total);
  // The items that u chooses, from `first` on; u becomes uniform again. slot_of: the slot of an
  // item.
  template <class SlotOf>
  static wide::Ints choose(const SlotOf& slot_of, const wide::Ints& first, const wide::Ints& count,
                           wide::Doubles& u);
  class Builder;

  int width_, height_, grid_width_;
  std::vector<double> cos_theta_;  // of each row of texels
  HugePageVector<Square> grid_;
  HugePageVector<Leaf> leaves_;
  std::vector<Block> blocks_;
  std::vector<Slot> block_slots_;
  double inverse_total_ = 0;  // 1 / integral over the sphere of the density before it is normalised
};

}  // namespace limn
