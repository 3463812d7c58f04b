// A balanced tree over the boxes of trees.
#include "edgetree/forest/root_boxes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace limn {
namespace {

constexpr size_t kFew = 32;  // not tuned

}  // namespace

RootBoxes::RootBoxes(const Forest& forest, std::span<const NodeId> roots)
    : roots_(roots.begin(), roots.end()) {
  if (roots_.size() <= kFew) return;
  std::vector<Bounds> boxes;
  for (const NodeId root : roots_) {
    // A node's frame is a cube around its edges, but for their rounding.
    const NodeHead& head = forest.head(root);
    const double radius = (1 + 0x1p-20) / head.inverse_radius + 0x1p-20 * forest.extent;
    const Vec3d center{head.center[0], head.center[1], head.center[2]};
    const Vec3d half{radius, radius, radius};
    Bounds box;
    box.extend(center - half);
    box.extend(center + half);
    boxes.push_back(box);
  }
  order_.resize(roots_.size());
  std::iota(order_.begin(), order_.end(), 0);
  nodes_.reserve(2 * roots_.size() - 1);
  build(boxes, 0, roots_.size());
}

size_t RootBoxes::build(std::span<const Bounds> boxes, size_t first, size_t count) {
  const size_t node = nodes_.size();
  nodes_.emplace_back();
  Bounds bounds, centers;
  for (size_t i = first; i < first + count; ++i) {
    const Bounds& box = boxes[order_[i]];
    bounds.extend(box.lower);
    bounds.extend(box.upper);
    centers.extend(box.center());
  }
  nodes_[node] = {bounds.center(), (bounds.upper - bounds.lower) * (0.5 * (1 + 0x1p-40))};
  if (count == 1) return node;
  const Vec3d size = centers.upper - centers.lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto begin = order_.begin() + static_cast<std::ptrdiff_t>(first);
  const auto middle = begin + static_cast<std::ptrdiff_t>(count / 2);
  std::nth_element(begin, middle, begin + static_cast<std::ptrdiff_t>(count),
                   [&](uint32_t a, uint32_t b) {
                     const double x = boxes[a].center()[axis], y = boxes[b].center()[axis];
                     return x < y || (x == y && a < b);
                   });
  build(boxes, first, count / 2);
  build(boxes, first + count / 2, count - count / 2);
  return node;
}

void RootBoxes::find(const Vec3d& p, const Vec3d& n, const DirectionCone& cone,
                     std::vector<NodeId>& found) const {
  if (nodes_.empty()) {
    found = roots_;
    return;
  }
  // The forest's own tests are in floats, and look at less.
  constexpr double kRounding = 0x1p-20;
  const auto reaches = [&](const Node& node) {
    const Vec3d d = node.center - p;
    const double far = length(d) + length(node.half);
    const auto is_above = [&](const Vec3d& plane) {
      const double most = dot(plane, d) + std::fabs(plane.x) * node.half.x +
                          std::fabs(plane.y) * node.half.y + std::fabs(plane.z) * node.half.z;
      return most >= -(cone.slack + kRounding) * far;
    };
    return is_above(n) &&
           std::all_of(cone.planes.begin(), cone.planes.begin() + cone.count, is_above);
  };
  struct Part {
    size_t node, first, count;
  };
  static thread_local std::vector<Part> stack;
  static thread_local std::vector<uint32_t> indices;
  indices.clear();
  stack.assign(1, {0, 0, roots_.size()});
  while (!stack.empty()) {
    const auto [node, first, count] = stack.back();
    stack.pop_back();
    if (!reaches(nodes_[node])) continue;
    if (count == 1) {
      indices.push_back(order_[first]);
      continue;
    }
    const size_t half = count / 2;
    stack.push_back({node + 2 * half, first + half, count - half});
    stack.push_back({node + 1, first, half});
  }
  std::sort(indices.begin(), indices.end());
  found.clear();
  for (const uint32_t index : indices) found.push_back(roots_[index]);
}

}  // namespace limn
