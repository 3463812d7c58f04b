#pragma once
// The shape of the paper's trees: which edges share a node (Sec. 4.1).
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "edgetree/forest/forest_fit.h"
#include "edgetree/forest/forest_split.h"
#include "edgetree/quadric/lanes.h"

namespace limn {

// A leaf, if it has kQuadricWidth edges or fewer.
struct QuadricSplit {
  EdgeRange range;
  std::array<EdgeRange, kQuadricWidth> ranges;     // of the children; empty for none
  std::array<uint32_t, kQuadricWidth> children{};  // 0 where the range is empty
  bool is_leaf() const { return range.size() <= kQuadricWidth; }
};

struct QuadricShape {
  std::vector<QuadricSplit> nodes;  // the root first; parents before children
  std::vector<uint32_t> order;      // ranges refer to this permutation of the wedges
  // Subtrees that one thread made, next to each other behind all other nodes: their first nodes,
  // and the number of all nodes.
  std::vector<uint32_t> parts;
};

// Three splits make a node's children: of the node, and of its two halves where they are no leaves.
// Each is the best, by the surface area heuristic, of ten planes at equal distances along the
// longest axis of the edges' box. wedges: at least one.
QuadricShape shape_of(std::span<const Wedge> wedges, int threads);

}  // namespace limn
