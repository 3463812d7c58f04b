#pragma once
// The sampling density of an environment map: compact enough to stay in the caches while the texels
// of a large map do not.
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/huge_pages.h"
#include "limn/core/prefetch.h"
#include "src/base/wide.h"

namespace limn {

// A density in solid angle over a map of W by H texels. A point (x, y) lies x columns to the right
// of the center of column 0, 0 <= x < W (wrapped), and y rows below the center of row 0, 0 <= y <=
// H - 1. Rows are equidistant in the polar angle theta, from 0 to pi.
//
// It is stored as a quadtree over the cells between texels. A leaf is a square of 1 to 64 cells per
// side (clipped at the border), drawn in proportion to its integral of the importance. Inside, the
// density is bilinear in azimuth and cos(theta), through the importance at the corners mixed with
// some of the mean. (Beside a black texel radiance falls with theta, the density with cos(theta):
// near a pole their ratio would be unbounded.) Leaves are as large as this permits. A smooth sky of
// half a million cells has some thousand. Where the importance is positive, so is the density.
//
// A draw descends the quadtree: one number chooses between left and right at every node and places
// in the leaf by what is left of it, the other between top and bottom. So numbers that are spread
// evenly over the unit square give draws that are (Clarberg et al. 2005).
class MapDensity {
 public:
  // importance: height by width, finite, not negative, one at least positive; height at least 2.
  MapDensity(int width, int height, std::span<const float> importance);

  // Eight samples at once: a single one is a chain of loads, roots and divisions with long
  // latencies.
  struct Drawn {
    wide::Doubles x, cos_theta, pdf;  // pdf [1/sr]
  };
  // Samples from two uniform numbers in [0, 1) each.
  Drawn sample(const wide::Doubles& u1, const wide::Doubles& u2) const;
  // column, row: the cell of (x, y). cos_theta: that of y. [1/sr]
  double pdf(int column, int row, double x, double cos_theta) const;
  // Prefetches the data that `pdf` will read for the cell.
  void fetch(int column, int row) const { prefetch(&leaf(square(column, row), column, row)); }

  size_t leaf_count() const { return leaves_.size(); }

 private:
  static constexpr int kGridLog = 3;     // log2 of a grid square's side, the unit of leaf lookup
  static constexpr int kLargestLog = 6;  // log2 of the largest leaf's side. Both not tuned

  using Corners = std::array<uint8_t, 4>;  // top left, top right, bottom left, bottom right

  // The data of a leaf, in one cache line.
  struct Leaf {
    float scale;      // converts `corners` to the unnormalised density
    Corners corners;  // at least 1
    uint32_t column;  // of its first cell
    uint32_t row : 28;
    uint32_t log : 4;  // log2 of its side
  };
  // A square of several leaves: its quarters, left ones first and of those the upper.
  struct Node {
    double left;         // share of its left half
    double upper[2];     // shares of the upper quarters in its halves
    int32_t quarter[4];  // nodes; of leaves the complement
  };
  // A grid square: index of its first leaf, and log2 of its leaves' side. A leaf larger than the
  // square is shared by all squares that it covers.
  struct Square {
    uint32_t first : 28;
    uint32_t log : 4;
  };
  // The extent of a leaf: cells [x0, x1) by [y0, y1).
  struct Patch {
    int x0, y0, x1, y1;
  };

  Patch patch(int column, int row, int log) const;
  const Square& square(int column, int row) const {
    return grid_[static_cast<size_t>(row >> kGridLog) * grid_width_ + (column >> kGridLog)];
  }
  const Leaf& leaf(const Square& square, int column, int row) const;
  double solid_angle(const Leaf& leaf) const;  // [sr]
  double mass(const Leaf& leaf) const;         // integral of the unnormalised density
  // The node of the square of this side whose first cell is given, or the complement of its leaf,
  // and its mass.
  struct Grown {
    int32_t node;
    double mass;
  };
  Grown grow(int column, int row, int log);
  class Builder;

  int width_, height_, grid_width_;
  std::vector<double> cos_theta_;  // of each row of texels
  HugePageVector<Square> grid_;
  HugePageVector<Leaf> leaves_;
  HugePageVector<Node> nodes_;
  int32_t root_;              // as `quarter`
  double inverse_total_ = 0;  // 1 / integral of the unnormalised density over the sphere
};

}  // namespace limn
