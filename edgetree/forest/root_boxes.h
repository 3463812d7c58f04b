#pragma once
// The trees of a forest of many objects, by where they are: which of them reach into a cone.
#include <span>
#include <vector>

#include "edgetree/forest/forest_node.h"
#include "limn/core/bounds.h"
#include "limn/edgetree/direction_cone.h"

namespace limn {

class RootBoxes {
 public:
  RootBoxes() = default;
  // Few trees have no boxes: all are found.
  RootBoxes(const Forest& forest, std::span<const NodeId> roots);

  // Replaces `found` by the trees that may hold a point x with x - p in the cone and above the
  // horizon of n, and perhaps others, in their order. Rounding loses none.
  void find(const Vec3d& p, const Vec3d& n, const DirectionCone& cone,
            std::vector<NodeId>& found) const;

 private:
  // In preorder: the first child of node i is i + 1. `count` trees below halve into count / 2 and
  // the others.
  struct Node {
    Vec3d center, half;
  };
  size_t build(std::span<const Bounds> boxes, size_t first, size_t count);

  std::vector<NodeId> roots_;
  std::vector<Node> nodes_;      // none of few trees
  std::vector<uint32_t> order_;  // indices of roots from left to right
};

}  // namespace limn
