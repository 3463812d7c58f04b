#pragma once
// Which of many boxes overlap.
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

struct FloatBox {
  std::array<float, 3> lower, upper;
};

// Whether two boxes have a point in common, their sides included.
inline bool overlap(const FloatBox& a, const FloatBox& b) {
  bool common = true;
  for (int k = 0; k < 3; ++k)
    common = common & (a.lower[k] <= b.upper[k]) & (b.lower[k] <= a.upper[k]);
  return common;
}

// A complete binary tree over boxes. Each is taken as a point of six coordinates, and nodes are cut
// at the median of the widest of these: so few large boxes come apart from many small ones.
class OverlapTree {
 public:
  // The result does not depend on `threads`.
  OverlapTree(const std::vector<FloatBox>& boxes, int threads);

  // The boxes in the order of the tree, as indices into those given.
  const std::vector<uint32_t>& order() const { return order_; }

  // The search for pairs, in independent parts that stand in a fixed order. `visit` is called with
  // the places of two different boxes in order(), once for every pair that overlaps.
  size_t parts() const { return parts_.size(); }
  using Visit = std::function<void(uint32_t, uint32_t)>;
  void visit_pairs(size_t part, const Visit& visit) const { visit_pairs(parts_[part], visit); }

 private:
  // Node i has the children 2 i + 1 and 2 i + 2; the last level has none.
  struct Node {
    FloatBox box;
    uint32_t begin, end;  // places of its boxes
  };
  struct Pair {
    uint32_t a, b;  // nodes of one level, a <= b
  };
  struct Item;

  bool is_leaf(uint32_t node) const { return 2 * node + 1 >= nodes_.size(); }
  void build(std::vector<Item>& items, int threads);
  void make_parts();
  int descend(const Pair& pair, Pair (&next)[4]) const;
  void visit_pairs(const Pair& pair, const Visit& visit) const;
  void visit_leaves(const Pair& pair, const Visit& visit) const;

  std::vector<Node> nodes_;
  std::vector<FloatBox> boxes_;  // in the order of the tree
  std::vector<uint32_t> order_;
  std::vector<Pair> parts_;
};

}  // namespace limn
