#pragma once
// The tree of an edge sampler as its rejection test sees it, for pictures, counts and tests.
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/vec.h"
#include "limn/edgetree/edges.h"

namespace limn {

// A set of edges that one test rejects or accepts as a whole.
struct RejectionNode {
  uint32_t parent;      // RejectionTree::kNoNode for those that the first choice is among
  uint32_t after;       // those below node i are the nodes [i + 1, after); none below an edge
  uint32_t depth;       // choices that lead here, from 1
  uint32_t begin, end;  // its edges are RejectionTree::edges()[begin, end)
};

class RejectionTree {
 public:
  static constexpr uint32_t kNoNode = UINT32_MAX;

  virtual ~RejectionTree() = default;

  // Depth first.
  std::span<const RejectionNode> nodes() const { return nodes_; }
  std::span<const EdgeRef> edges() const { return edges_; }
  std::span<const EdgeRef> edges(uint32_t node) const {
    return edges().subspan(nodes_[node].begin, nodes_[node].end - nodes_[node].begin);
  }

  // Whether the test finds that no edge of the node can be in E(p), by the code that sampling runs.
  // Horizon, motion and the test of an edge after it is drawn are left out. Thread-safe.
  virtual bool rejects(uint32_t node, const Vec3d& p) const = 0;

 protected:
  std::vector<RejectionNode> nodes_;
  std::vector<EdgeRef> edges_;
};

}  // namespace limn
