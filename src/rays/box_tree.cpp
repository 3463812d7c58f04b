// A bounding volume hierarchy over boxes that finds overlapping pairs.
#include "limn/core/box_tree.h"

#include <algorithm>
#include <cstring>
#include <limits>
#ifdef __AVX__
#include <immintrin.h>
#endif

#include "limn/core/parallel.h"

namespace limn {

namespace {

Bounds bounds(const FloatBox& box) {
  Bounds bounds;
  bounds.extend({box.lower[0], box.lower[1], box.lower[2]});
  bounds.extend({box.upper[0], box.upper[1], box.upper[2]});
  return bounds;
}

}  // namespace

void FloatBox::extend(const FloatBox& other) {
  for (int k = 0; k < 3; ++k) {
    lower[k] = std::min(lower[k], other.lower[k]);
    upper[k] = std::max(upper[k], other.upper[k]);
  }
}

LeafBoxes::LeafBoxes() {
  for (int k = 0; k < 3; ++k)
    for (uint32_t lane = 0; lane < kLanes; ++lane) {
      lower[k][lane] = std::numeric_limits<float>::infinity();
      upper[k][lane] = -std::numeric_limits<float>::infinity();
    }
}

void LeafBoxes::set(uint32_t lane, const FloatBox& box) {
  for (int k = 0; k < 3; ++k) {
    lower[k][lane] = box.lower[k];
    upper[k][lane] = box.upper[k];
  }
}

uint32_t LeafBoxes::overlaps(const FloatBox& box) const {
  using Eight [[gnu::vector_size(4 * kLanes)]] = float;
  using Mask [[gnu::vector_size(4 * kLanes)]] = int32_t;
  Mask apart{};
  for (int k = 0; k < 3; ++k) {
    Eight low, high;
    std::memcpy(&low, lower[k], sizeof(low));
    std::memcpy(&high, upper[k], sizeof(high));
    apart |= (low > box.upper[k]) | (high < box.lower[k]);
  }
#ifdef __AVX__
  return static_cast<uint32_t>(~_mm256_movemask_ps(reinterpret_cast<__m256>(apart)) & 255);
#else
  uint32_t bits = 0;
  for (uint32_t lane = 0; lane < kLanes; ++lane)
    bits |= static_cast<uint32_t>(!apart[lane]) << lane;
  return bits;
#endif
}

BoxTree::BoxTree(std::span<const FloatBox> boxes, int threads, Inside inside)
    : boxes_(boxes),
      leaves_(static_cast<uint32_t>((boxes.size() + kLeaf - 1) / kLeaf)),
      inside_(std::move(inside)) {
  if (leaves_ == 0) return;
  items_.reserve(boxes.size());
  for (uint32_t i = 0; i < boxes.size(); ++i) {
    const auto& [low, high] = boxes[i];
    items_.push_back({{low[0] + high[0], low[1] + high[1], low[2] + high[2]}, i});
  }
  nodes_.resize(2 * leaves_ - 1);
  if (inside_) oriented_.resize(nodes_.size());
  leaf_nodes_.resize(leaves_);
  packed_.resize(leaves_);
  order_.resize(boxes.size());
  const Part root{0, 0, leaves_};
  const uint32_t smallest = std::max(leaves_ / 32, 1u);  // several parts per thread; not tuned
  std::vector<Part> parts;
  split(root, smallest, parts);
  parallel_for(parts.size(), threads, [&](size_t i) { build(parts[i]); });
  join_boxes(root, smallest);
  items_ = {};
}

void BoxTree::split(const Part& part, uint32_t smallest, std::vector<Part>& parts) {
  if (part.count <= smallest) {
    parts.push_back(part);
    return;
  }
  halve(part);
  split(part.left(), smallest, parts);
  split(part.right(), smallest, parts);
}

// Splits at the median, along the axis on which the centers spread most.
void BoxTree::halve(const Part& part) {
  const auto begin = items_.begin() + part.first * kLeaf;
  const auto end =
      items_.begin() + std::min<size_t>((part.first + part.count) * kLeaf, items_.size());
  std::array<float, 3> low = begin->center, high = low;
  for (auto item = begin; item != end; ++item) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], item->center[k]);
      high[k] = std::max(high[k], item->center[k]);
    }
  }
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (high[k] - low[k] > high[axis] - low[axis]) axis = k;
  std::nth_element(
      begin, items_.begin() + part.right().first * kLeaf, end, [&](const Item& a, const Item& b) {
        return a.center[axis] != b.center[axis] ? a.center[axis] < b.center[axis] : a.box < b.box;
      });
}

void BoxTree::build(const Part& part) {
  if (part.count > 1) {
    halve(part);
    build(part.left());
    build(part.right());
    nodes_[part.node] = nodes_[part.left().node];
    nodes_[part.node].extend(nodes_[part.right().node]);
    orient(part);
    return;
  }
  const size_t begin = size_t{part.first} * kLeaf, end = std::min(begin + kLeaf, items_.size());
  FloatBox box = boxes_[items_[begin].box];
  for (size_t i = begin; i < end; ++i) {
    order_[i] = items_[i].box;
    box.extend(boxes_[order_[i]]);
    packed_[part.first].set(static_cast<uint32_t>(i - begin), boxes_[order_[i]]);
  }
  nodes_[part.node] = box;
  leaf_nodes_[part.first] = part.node;
  orient(part);
}

void BoxTree::orient(const Part& part) {
  if (!inside_) return;
  if (part.count > 1 && !(oriented_[part.left().node] && oriented_[part.right().node])) return;
  std::vector<FaceCorners> faces;
  double margin = 0;
  const size_t begin = size_t{part.first} * kLeaf;
  const size_t end = std::min(begin + size_t{part.count} * kLeaf, items_.size());
  for (size_t i = begin; i < end; ++i) {
    const auto [corners, reach] = inside_(items_[i].box);
    faces.push_back(corners);
    margin = std::max(margin, reach);
  }
  if (const auto box = thin_box(faces, margin, bounds(nodes_[part.node])))
    oriented_[part.node] = std::make_unique<OrientedBox>(*box);
}

bool BoxTree::are_apart(uint32_t a, uint32_t b) const {
  const OrientedBox *own = oriented_[a].get(), *other = oriented_[b].get();
  if (!own && !other) return false;
  return limn::are_apart(own ? *own : oriented(bounds(nodes_[a])),
                         other ? *other : oriented(bounds(nodes_[b])));
}

void BoxTree::join_boxes(const Part& part, uint32_t smallest) {
  if (part.count <= smallest) return;
  join_boxes(part.left(), smallest);
  join_boxes(part.right(), smallest);
  nodes_[part.node] = nodes_[part.left().node];
  nodes_[part.node].extend(nodes_[part.right().node]);
  orient(part);
}

std::span<const uint32_t> BoxTree::leaf(uint32_t leaf) const {
  const size_t begin = size_t{leaf} * kLeaf, end = std::min(begin + kLeaf, order_.size());
  return {&order_[begin], end - begin};
}

template <class Meets>
void BoxTree::find_leaves(uint32_t first, const Meets& meets, std::vector<uint32_t>& leaves) const {
  leaves.clear();
  if (leaves_ == 0) return;
  std::array<Part, 64> stack;  // depth is bounded: the tree is balanced
  size_t depth = 0;
  stack[depth++] = {0, 0, leaves_};
  while (depth > 0) {
    const Part part = stack[--depth];
    if (part.first + part.count <= first || !meets(part.node)) continue;
    if (part.count == 1) {
      leaves.push_back(part.first);
      continue;
    }
    stack[depth++] = part.right();
    stack[depth++] = part.left();
  }
}

void BoxTree::find_leaves(const FloatBox& box, uint32_t first,
                          std::vector<uint32_t>& leaves) const {
  find_leaves(
      first, [&](uint32_t node) { return nodes_[node].overlaps(box); }, leaves);
}

void BoxTree::find_near_leaves(uint32_t own, std::vector<uint32_t>& leaves) const {
  if (!inside_) return find_leaves(leaf_box(own), own, leaves);
  const uint32_t from = leaf_nodes_[own];
  const auto meets = [&](uint32_t node) {
    return nodes_[node].overlaps(nodes_[from]) && !are_apart(from, node);
  };
  find_leaves(own, meets, leaves);
}

void BoxTree::find_leaves(const Vec3d& from, const Vec3d& along, double s_max,
                          std::vector<uint32_t>& leaves) const {
  const auto meets = [&](uint32_t at) {
    const FloatBox& node = nodes_[at];
    double low = 0, high = s_max;
    for (int k = 0; k < 3; ++k) {
      if (along[k] == 0) {
        if (from[k] < node.lower[k] || from[k] > node.upper[k]) return false;
        continue;
      }
      const double a = (node.lower[k] - from[k]) / along[k];
      const double b = (node.upper[k] - from[k]) / along[k];
      low = std::max(low, std::min(a, b));
      high = std::min(high, std::max(a, b));
    }
    return low <= high;
  };
  find_leaves(0, meets, leaves);
}

}  // namespace limn
