#pragma once
// The shape of a tree: which edges share a node.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "forest_fit.h"

namespace limn {

struct EdgeRange {
  uint32_t begin = 0, end = 0;
  uint32_t size() const { return end - begin; }
};

// A node of up to four children; a child of one edge is that edge, others are nodes.
struct SplitNode {
  std::array<EdgeRange, 4> ranges;     // empty for none
  std::array<uint32_t, 4> children{};  // 0 where the range is empty or one edge
  EdgeRange range;
};

struct SplitTree {
  std::vector<SplitNode> nodes;  // the root first; parents before children
  std::vector<uint32_t> order;   // ranges refer to this permutation of the wedges
};

// wedges: at least one.
SplitTree split_edges(std::span<const Wedge> wedges, int threads);

}  // namespace limn
