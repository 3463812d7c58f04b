// A bounding volume hierarchy over faces, split at the median of their centers.
#include "limn/core/face_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <tuple>

#include "limn/core/bounds.h"
#include "limn/core/check.h"

namespace limn {
namespace {

constexpr uint32_t kLeaf = 4;  // faces; not tuned

// Three times the coordinate of the center.
float middle(const FaceTree::Item& item, int axis) {
  return item.corners[0][axis] + item.corners[1][axis] + item.corners[2][axis];
}

// A side of an item, identified by the positions of its ends.
struct ItemSide {
  Vec3f low, high;
  uint32_t item;
  uint8_t side;
  bool forward;
  auto ends() const { return std::tie(low.x, low.y, low.z, high.x, high.y, high.z); }
};

}  // namespace

FaceTree::FaceTree(const Scene& scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const FaceIndices& ids = mesh.faces[f];
      if (!has_area(mesh, ids)) continue;
      items_.push_back({{ShapeId(s), FaceId(f)},
                        {mesh.positions[ids[0]], mesh.positions[ids[1]], mesh.positions[ids[2]]},
                        {kNone, kNone, kNone}});
    }
  }
  if (!items_.empty()) build(0, static_cast<uint32_t>(items_.size()));
}

void FaceTree::find_neighbours() {
  std::vector<ItemSide> sides;
  sides.reserve(3 * items_.size());
  for (uint32_t i = 0; i < items_.size(); ++i) {
    for (uint8_t k = 0; k < 3; ++k) {
      const Vec3f &a = items_[i].corners[k], &b = items_[i].corners[(k + 1) % 3];
      const bool forward = std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
      sides.push_back({forward ? a : b, forward ? b : a, i, k, forward});
    }
  }
  std::sort(sides.begin(), sides.end(),
            [](const ItemSide& a, const ItemSide& b) { return a.ends() < b.ends(); });
  for (size_t first = 0, last; first < sides.size(); first = last) {
    for (last = first + 1; last < sides.size() && sides[last].ends() == sides[first].ends();)
      ++last;
    const ItemSide &a = sides[first], &b = sides[last - 1];
    if (last - first != 2 || a.forward == b.forward) continue;
    items_[a.item].neighbours[a.side] = b.item;
    items_[b.item].neighbours[b.side] = a.item;
  }
}

uint32_t FaceTree::build(uint32_t first, uint32_t last) {
  Bounds bounds;
  for (uint32_t i = first; i < last; ++i) {
    for (const Vec3f& x : items_[i].corners) bounds.extend(cast<double>(x));
  }
  const auto index = static_cast<uint32_t>(nodes_.size());
  nodes_.push_back({bounds.center(), (bounds.upper - bounds.lower) * 0.5, first, last - first});
  if (last - first <= kLeaf) return index;
  const Vec3d half = nodes_[index].half;
  const int axis = half.x >= half.y && half.x >= half.z ? 0 : half.y >= half.z ? 1 : 2;
  const uint32_t cut = first + (last - first) / 2;
  std::nth_element(items_.begin() + first, items_.begin() + cut, items_.begin() + last,
                   [&](const Item& a, const Item& b) { return middle(a, axis) < middle(b, axis); });
  build(first, cut);
  const uint32_t right = build(cut, last);
  nodes_[index].first = right;
  nodes_[index].count = 0;
  return index;
}

void FaceTree::list(std::span<const HalfSpace> set, std::vector<const Item*>& faces) const {
  if (nodes_.empty()) return;
  CHECK_LT(set.size(), 32u);
  // cut_by: bits of the half-spaces that do not contain the node entirely.
  struct Visit {
    uint32_t node, cut_by;
  };
  const auto bit = [](size_t k) { return uint32_t{1} << k; };
  // Clears the bits of half-spaces that contain the node; false if it is outside of one.
  const auto reaches = [&](const Node& node, uint32_t& cut_by) {
    for (uint32_t left = cut_by; left != 0; left &= left - 1) {
      const auto k = static_cast<size_t>(std::countr_zero(left));
      const HalfSpace& h = set[k];
      const double reach = std::fabs(h.n.x) * node.half.x + std::fabs(h.n.y) * node.half.y +
                           std::fabs(h.n.z) * node.half.z;
      const double middle = dot(h.n, node.center) + h.offset;
      if (middle + reach < 0) return false;
      if (middle - reach > 0) cut_by &= ~bit(k);
    }
    return true;
  };
  const auto leaves_out = [&](const Item& item, uint32_t cut_by) {
    for (uint32_t left = cut_by; left != 0; left &= left - 1) {
      const HalfSpace& h = set[static_cast<size_t>(std::countr_zero(left))];
      const auto outside = [&](const Vec3f& x) { return dot(h.n, cast<double>(x)) + h.offset < 0; };
      const auto& x = item.corners;
      if (outside(x[0]) && outside(x[1]) && outside(x[2])) return true;
    }
    return false;
  };
  Visit stack[64];  // the tree is balanced
  int depth = 0;
  stack[depth++] = {0, bit(set.size()) - 1};
  while (depth > 0) {
    auto [index, cut_by] = stack[--depth];
    const Node& node = nodes_[index];
    if (!reaches(node, cut_by)) continue;
    if (node.count == 0) {
      stack[depth++] = {node.first, cut_by};
      stack[depth++] = {index + 1, cut_by};
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (!leaves_out(items_[i], cut_by)) faces.push_back(&items_[i]);
    }
  }
}

}  // namespace limn
