#pragma once
// The topology of a tree over edges, for any rule that splits a node's edges among children.
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "limn/core/parallel.h"

namespace limn {

struct EdgeRange {
  uint32_t begin = 0, end = 0;
  uint32_t size() const { return end - begin; }
};

// A node of up to `Width` children, or of edges only.
template <size_t Width>
struct SplitNode {
  std::array<EdgeRange, Width> ranges;     // of the children; empty if absent
  std::array<uint32_t, Width> children{};  // 0 if absent
  EdgeRange range;
  bool has_edges = false;
};

template <size_t Width>
struct SplitTree {
  std::vector<SplitNode<Width>> nodes;  // the root first; parents before children
  std::vector<uint32_t> order;          // ranges refer to this permutation of the edges
  // Subtrees made by one thread each, stored consecutively after all other nodes: their first
  // nodes, and the number of all nodes.
  std::vector<uint32_t> parts;
};

// A child that is not built yet.
struct PendingChild {
  uint32_t node;
  uint32_t lane;
};

// Appends the subtree over a range. Below its first node, ranges of at most `stop` edges are
// appended to `pending` instead.
template <size_t Width, class NodeOver>
void append_subtree(EdgeRange range, uint32_t stop, const NodeOver& node_over,
                    std::vector<SplitNode<Width>>& nodes, std::vector<PendingChild>* pending) {
  const auto index = static_cast<uint32_t>(nodes.size());
  nodes.push_back(node_over(range));
  if (nodes[index].has_edges) return;
  for (uint32_t lane = 0; lane < Width; ++lane) {
    const EdgeRange child = nodes[index].ranges[lane];
    if (child.size() == 0) continue;
    if (child.size() <= stop) {
      pending->push_back({index, lane});
      continue;
    }
    nodes[index].children[lane] = static_cast<uint32_t>(nodes.size());
    append_subtree(child, stop, node_over, nodes, pending);
  }
}

// Builds the tree over `edges` >= 1 edges; the result does not depend on the number of threads.
// node_over(range) returns a SplitNode<Width> without child indices. It may reorder the edges of
// the range, and runs in parallel for disjoint ranges. The caller fills `order`.
template <size_t Width, class NodeOver>
SplitTree<Width> split_tree(uint32_t edges, int threads, const NodeOver& node_over) {
  constexpr uint32_t kTask = 4096;  // edges per thread task; not tuned
  SplitTree<Width> tree;
  std::vector<PendingChild> pending;
  append_subtree<Width>({0, edges}, edges > kTask ? kTask : 0, node_over, tree.nodes, &pending);
  std::vector<std::vector<SplitNode<Width>>> parts(pending.size());
  parallel_for(parts.size(), threads, [&](size_t i) {
    const EdgeRange range = tree.nodes[pending[i].node].ranges[pending[i].lane];
    append_subtree<Width>(range, 0, node_over, parts[i], nullptr);
  });
  size_t nodes = tree.nodes.size();
  for (const auto& part : parts) nodes += part.size();
  tree.nodes.reserve(nodes);
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto offset = static_cast<uint32_t>(tree.nodes.size());
    tree.parts.push_back(offset);
    tree.nodes[pending[i].node].children[pending[i].lane] = offset;
    for (SplitNode<Width>& node : parts[i]) {
      for (uint32_t& child : node.children)
        if (child != 0) child += offset;
      tree.nodes.push_back(node);
    }
    parts[i] = {};
  }
  tree.parts.push_back(static_cast<uint32_t>(tree.nodes.size()));
  return tree;
}

}  // namespace limn
