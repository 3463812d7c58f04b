#pragma once
// A bounding volume hierarchy over boxes that finds overlapping pairs.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace limn {

struct FloatBox {
  std::array<float, 3> lower, upper;

  bool overlaps(const FloatBox& other) const {
    for (int k = 0; k < 3; ++k)
      if (lower[k] > other.upper[k] || other.lower[k] > upper[k]) return false;
    return true;
  }
  void extend(const FloatBox& other);
};

// Eight boxes in structure-of-arrays layout for SIMD; an unused slot overlaps nothing.
struct LeafBoxes {
  static constexpr uint32_t kLanes = 8;  // not tuned
  float lower[3][kLanes], upper[3][kLanes];

  LeafBoxes();
  void set(uint32_t lane, const FloatBox& box);
  // Bit i is set if `box` overlaps the box in slot i.
  uint32_t overlaps(const FloatBox& box) const;
};

// Median splits along the axis of widest centers, until a leaf holds at most kLeaf boxes. The boxes
// must be finite and outlive the tree.
class BoxTree {
 public:
  static constexpr uint32_t kLeaf = LeafBoxes::kLanes;

  BoxTree(std::span<const FloatBox> boxes, int threads);

  uint32_t leaf_count() const { return leaves_; }
  const FloatBox& leaf_box(uint32_t leaf) const { return leaf_boxes_[leaf]; }
  // The indices of the boxes in a leaf, and the boxes themselves.
  std::span<const uint32_t> leaf(uint32_t leaf) const;
  const LeafBoxes& boxes(uint32_t leaf) const { return packed_[leaf]; }
  // Sets `leaves` to the leaves >= `first` whose bounds overlap `box`, in ascending order.
  void find_leaves(const FloatBox& box, uint32_t first, std::vector<uint32_t>& leaves) const;

 private:
  struct Item {
    std::array<float, 3> center;  // twice the center
    uint32_t box;
  };
  // A subtree over `count` leaves, starting with the leaf `first`. It occupies nodes_[node, node +
  // 2 count - 1); its left child, over count / 2 leaves, follows it directly.
  struct Part {
    uint32_t node, first, count;
    Part left() const { return {node + 1, first, count / 2}; }
    Part right() const { return {node + 2 * (count / 2), first + count / 2, count - count / 2}; }
  };
  // Splits `part` until each piece has at most `smallest` leaves; appends the pieces to `parts`.
  void split(const Part& part, uint32_t smallest, std::vector<Part>& parts);
  void halve(const Part& part);
  void build(const Part& part);
  void join_boxes(const Part& part, uint32_t smallest);

  std::span<const FloatBox> boxes_;
  uint32_t leaves_;
  std::vector<Item> items_;
  std::vector<uint32_t> order_;
  std::vector<FloatBox> nodes_, leaf_boxes_;
  std::vector<LeafBoxes> packed_;
};

}  // namespace limn
