#pragma once
// A bounding volume hierarchy over boxes that finds overlapping pairs, and boxes along lines.
#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "limn/core/bounds.h"
#include "limn/core/parallel.h"
#include "limn/core/vec.h"

namespace limn {

using FaceCorners = std::array<Vec3d, 3>;

struct OrientedBox {
  Vec3d center;
  std::array<Vec3d, 3> axes;  // unit, perpendicular to each other
  Vec3d half;                 // half of its size along each axis
};

// A box along the axes of the world in this form.
OrientedBox oriented(const Bounds& bounds);

// True if a plane along two axes of one box, or along the first axis of each, separates them. It
// may be false for boxes that do not overlap.
bool are_apart(const OrientedBox& a, const OrientedBox& b);

// The box around faces, `margin` larger on every side, along the longest side and the normal of the
// first, if it has at most a quarter of the area of `aligned`. margin must exceed the rounding of
// doubles. There must be a face; its area may be zero.
std::optional<OrientedBox> thin_box(std::span<const FaceCorners> faces, double margin,
                                    const Bounds& aligned);

// The box around faces along the longest side of all, if there the boxes of single faces have at
// most a quarter of the area of their axis-aligned ones.
std::optional<OrientedBox> box_of_slivers(std::span<const FaceCorners> faces);

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

  // The corners of a face inside of box i, and by how much the box is larger on every side.
  // Thread-safe.
  using Inside = std::function<std::pair<FaceCorners, double>(uint32_t i)>;

  // inside: if given, find_pairs omits pairs of boxes whose faces are apart by more than these
  // margins, where many such are found together.
  BoxTree(std::span<const FloatBox> boxes, int threads, Inside inside = {});

  uint32_t leaf_count() const { return leaves_; }
  const FloatBox& leaf_box(uint32_t leaf) const { return nodes_[leaf_nodes_[leaf]]; }
  // The indices of the boxes in a leaf, and the boxes themselves.
  std::span<const uint32_t> leaf(uint32_t leaf) const;
  const LeafBoxes& boxes(uint32_t leaf) const { return packed_[leaf]; }
  // Sets `leaves` to the leaves >= `first` whose bounds overlap `box`, in ascending order.
  void find_leaves(const FloatBox& box, uint32_t first, std::vector<uint32_t>& leaves) const;
  // The same with leaves whose bounds the line from + s along meets for some s in [0, s_max].
  void find_leaves(const Vec3d& from, const Vec3d& along, double s_max,
                   std::vector<uint32_t>& leaves) const;
  // Calls append(i, j, found) for the indices i < j of every pair of overlapping boxes, in
  // parallel, and returns all that it appended to `found`; the order does not depend on `threads`.
  // skip(i, leaf): bits of boxes in the leaf whose pairs with box i are omitted.
  template <class Item, class Skip, class Append>
  std::vector<Item> find_pairs(int threads, const Skip& skip, const Append& append) const;

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
  // Those whose nodes meets(node) accepts.
  template <class Meets>
  void find_leaves(uint32_t first, const Meets& meets, std::vector<uint32_t>& leaves) const;
  // For find_pairs: leaves >= `own` that may hold faces near to its own.
  void find_near_leaves(uint32_t own, std::vector<uint32_t>& leaves) const;
  // Sets the oriented box of a node whose children, if any, have theirs.
  void orient(const Part& part);
  bool are_apart(uint32_t a, uint32_t b) const;
  void halve(const Part& part);
  void build(const Part& part);
  void join_boxes(const Part& part, uint32_t smallest);

  std::span<const FloatBox> boxes_;
  uint32_t leaves_;
  std::vector<Item> items_;
  std::vector<uint32_t> order_;
  std::vector<FloatBox> nodes_;
  std::vector<uint32_t> leaf_nodes_;
  Inside inside_;
  std::vector<std::unique_ptr<OrientedBox>> oriented_;  // of nodes; null: far larger than its own
  std::vector<LeafBoxes> packed_;
};

template <class Item, class Skip, class Append>
std::vector<Item> BoxTree::find_pairs(int threads, const Skip& skip, const Append& append) const {
  constexpr uint32_t kBlock = 256;  // leaves; not tuned
  std::vector<std::vector<Item>> found((leaves_ + kBlock - 1) / kBlock);
  parallel_for(found.size(), threads, [&](size_t block) {
    std::vector<uint32_t> others;
    const auto begin = static_cast<uint32_t>(block) * kBlock;
    for (uint32_t own = begin; own < std::min(begin + kBlock, leaves_); ++own) {
      find_near_leaves(own, others);
      for (const uint32_t other : others)
        for (size_t k = 0; k < leaf(own).size(); ++k) {
          const uint32_t i = leaf(own)[k];
          uint32_t bits = boxes(other).overlaps(boxes_[i]);
          if (other == own) bits &= ~((2u << k) - 1);
          if (bits != 0) bits &= ~skip(i, other);
          for (; bits != 0; bits &= bits - 1) {
            const uint32_t j = leaf(other)[static_cast<size_t>(std::countr_zero(bits))];
            append(std::min(i, j), std::max(i, j), found[block]);
          }
        }
    }
  });
  std::vector<Item> all;
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return all;
}

}  // namespace limn
