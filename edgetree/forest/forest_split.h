#pragma once
// The shape of a tree: which edges share a node.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "edgetree/forest/forest_fit.h"
#include "edgetree/simd.h"

namespace limn {

struct EdgeRange {
  uint32_t begin = 0, end = 0;
  uint32_t size() const { return end - begin; }
};

// A node of up to `width` children: all of them are nodes or, if it has no more edges than that,
// all are edges.
struct SplitNode {
  std::array<EdgeRange, kWidth> ranges;     // empty for none
  std::array<uint32_t, kWidth> children{};  // 0 where the range is empty or one edge
  EdgeRange range;
  bool has_edges = false;
};

struct SplitTree {
  std::vector<SplitNode> nodes;  // the root first; parents before children
  std::vector<uint32_t> order;   // ranges refer to this permutation of the wedges
};

// wedges: at least one. width: 2 to kWidth.
SplitTree split_edges(std::span<const Wedge> wedges, uint32_t width, int threads);

}  // namespace limn
