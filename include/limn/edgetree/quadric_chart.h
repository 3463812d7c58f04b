#pragma once
// The planes that a node of the paper's forest holds, and the pair of quadrics that bounds them, in
// the coordinates of the node's dual box: for drawing.
#include <array>
#include <optional>
#include <vector>

#include "limn/core/vec.h"
#include "limn/edgetree/rejection_tree.h"

namespace limn {

// u in [-1, 1]^3. The planes of the family between the two quadrics are those with
// low <= f(u) <= high, f(u) = sum of linear_k u_k + square_k u_k^2 + product_k u_i u_j with i, j
// the two others than k.
struct QuadricChart {
  std::array<double, 3> linear, square, product;
  double low, high;
  // The two planes of each edge: its wedge is the segment between them.
  std::vector<std::array<Vec3d, 2>> edges;
};

class ChartedTree : public RejectionTree {
 public:
  // None for an edge by itself, where there are no quadrics, where they never reject, and where a
  // box is so thin that its coordinates are rounding.
  virtual std::optional<QuadricChart> chart(uint32_t node) const = 0;
};

}  // namespace limn
