#pragma once
// The planes of a node of the paper's forest and the quadrics that bound them, in the coordinates
// of the node's dual box: for drawing.
#include <array>
#include <optional>
#include <vector>

#include "limn/core/vec.h"
#include "limn/edgetree/rejection_tree.h"

namespace limn {

// With u in [-1, 1]^3, the planes between the two quadrics are those with low <= f(u) <= high. f(u)
// = sum of linear_k u_k + square_k u_k^2 + product_k u_i u_j, with i, j the two indices other than
// k.
struct QuadricChart {
  std::array<double, 3> linear, square, product;
  double low, high;
  // The face planes of each edge; the edge's wedge is the segment between them.
  std::vector<std::array<Vec3d, 2>> edges;
};

class ChartedTree : public RejectionTree {
 public:
  // Nothing for a single edge, for a node without quadrics or with quadrics that never reject, and
  // for a box so thin that its coordinates are rounding errors.
  virtual std::optional<QuadricChart> chart(uint32_t node) const = 0;
};

}  // namespace limn
