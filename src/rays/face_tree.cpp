// Faces halved at the median of their centers, and found from the root.
#include "limn/core/face_tree.h"

#include <algorithm>
#include <cmath>

#include "limn/core/bounds.h"

namespace limn {
namespace {

constexpr uint32_t kLeaf = 4;  // faces; not tuned

// Three times the center along an axis.
float middle(const FaceTree::Item& item, int axis) {
  return item.corners[0][axis] + item.corners[1][axis] + item.corners[2][axis];
}

}  // namespace

FaceTree::FaceTree(const Scene& scene) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Mesh& mesh = scene.shapes[s].mesh;
    for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
      const FaceIndices& ids = mesh.faces[f];
      if (!has_area(mesh, ids)) continue;
      items_.push_back({{ShapeId(s), FaceId(f)},
                        {mesh.positions[ids[0]], mesh.positions[ids[1]], mesh.positions[ids[2]]}});
    }
  }
  if (!items_.empty()) build(0, static_cast<uint32_t>(items_.size()));
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
  const auto misses = [&](const Node& node) {
    return std::any_of(set.begin(), set.end(), [&](const HalfSpace& h) {
      const double reach = std::fabs(h.n.x) * node.half.x + std::fabs(h.n.y) * node.half.y +
                           std::fabs(h.n.z) * node.half.z;
      return dot(h.n, node.center) + h.offset + reach < 0;
    });
  };
  const auto leaves_out = [&](const Item& item) {
    return std::any_of(set.begin(), set.end(), [&](const HalfSpace& h) {
      return std::all_of(item.corners.begin(), item.corners.end(),
                         [&](const Vec3f& x) { return dot(h.n, cast<double>(x)) + h.offset < 0; });
    });
  };
  if (nodes_.empty()) return;
  uint32_t stack[64];  // the tree is balanced
  int depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const uint32_t index = stack[--depth];
    const Node& node = nodes_[index];
    if (misses(node)) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = index + 1;
      continue;
    }
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      if (!leaves_out(items_[i])) faces.push_back(&items_[i]);
    }
  }
}

}  // namespace limn
