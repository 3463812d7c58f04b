#pragma once
// A sampler's tree as its rejection test sees it, for images, statistics and tests.
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/vec.h"
#include "limn/edgetree/edges.h"

namespace limn {

// A set of edges that one test accepts or rejects as a whole.
struct RejectionNode {
  uint32_t parent;      // kNoNode for the nodes of the first choice
  uint32_t after;       // descendants of node i are [i + 1, after); none below an edge
  uint32_t depth;       // number of choices that lead here, from 1
  uint32_t begin, end;  // its edges are RejectionTree::edges()[begin, end)
};

class RejectionTree {
 public:
  static constexpr uint32_t kNoNode = UINT32_MAX;

  virtual ~RejectionTree() = default;

  // In depth-first order.
  std::span<const RejectionNode> nodes() const { return nodes_; }
  std::span<const EdgeRef> edges() const { return edges_; }
  std::span<const EdgeRef> edges(uint32_t node) const {
    return edges().subspan(nodes_[node].begin, nodes_[node].end - nodes_[node].begin);
  }

  // True if the test proves that no edge of the node is in E(p), with the code used for sampling.
  // Excludes horizon, motion and the test of a drawn edge. Thread-safe.
  virtual bool rejects(uint32_t node, const Vec3d& p) const = 0;

 protected:
  std::vector<RejectionNode> nodes_;
  std::vector<EdgeRef> edges_;
};

}  // namespace limn
