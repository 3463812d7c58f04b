// The edge forest as a RejectionTree.
#include "edgetree/forest/forest_build.h"

#include "edgetree/forest/forest_query.h"

namespace limn {
namespace {

class ForestRejectionTree final : public RejectionTree {
 public:
  explicit ForestRejectionTree(const Forest& forest) : forest_(forest) {
    for (const NodeId root : forest.roots) append(root, kNoNode, 1);
  }

  bool rejects(uint32_t node, const Vec3d& p) const override {
    const auto [id, lane] = slots_[node];
    const ForestPoint point = point_of(forest_, p);
    const Ints alive = id < 0 ? may_hold_candidates(forest_.edges[~id], point)
                              : may_hold_candidates(forest_.inner[id], point);
    return alive[lane] == 0;
  }

 private:
  struct Slot {
    NodeId node;
    int lane;
  };

  // Appends the children of a node and their descendants.
  void append(NodeId id, uint32_t parent, uint32_t depth) {
    const Ints& lanes = id < 0 ? forest_.edges[~id].edge : forest_.inner[id].child;
    for (int lane = 0; lane < kWidth; ++lane) {
      if (lanes[lane] == kNoChild) continue;
      const auto node = static_cast<uint32_t>(nodes_.size());
      nodes_.push_back({parent, 0, depth, static_cast<uint32_t>(edges_.size()), 0});
      slots_.push_back({id, lane});
      if (id < 0) {
        edges_.push_back(forest_.edges[~id].edge_at(lane));
      } else {
        append(lanes[lane], node, depth + 1);
      }
      nodes_[node].after = static_cast<uint32_t>(nodes_.size());
      nodes_[node].end = static_cast<uint32_t>(edges_.size());
    }
  }

  const Forest& forest_;
  std::vector<Slot> slots_;  // of each node
};

}  // namespace

std::unique_ptr<RejectionTree> make_forest_rejection_tree(const Forest& forest) {
  return std::make_unique<ForestRejectionTree>(forest);
}

}  // namespace limn
