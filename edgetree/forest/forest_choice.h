#pragma once
// Choosing among the children of nodes: from their weights, and from looks further down where a
// weight says little.
#include <vector>

#include "edgetree/bounds/forest_config.h"
#include "edgetree/forest/choose_root.h"
#include "edgetree/forest/forest_query.h"

namespace limn {

// A node, the weights of its children, and their sums in pairs, fours and all.
struct Choice {
  NodeId node = kNoChild;
  float weights[kWidth];
  double pairs[4], fours[2], total = 0;

  Choice() = default;
  Choice(NodeId id, Floats w);
  void set(int lane, double weight);

  // Draws a lane by the uniform number u and leaves another one in it; total > 0.
  int draw(double& u) const;

 private:
  void add_up();
};

// By what children weigh, looking ahead as configured. doubt: as of weigh_children, of inner nodes;
// zero of edges.
Choice choice_at(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
                 NodeId id, Floats* doubt = nullptr);

// The top of the trees, as one query sees it. The weight of a wide box says little of what is
// inside: a narrow lobe may pass beside most of it, or p is near some of it. Such children are
// opened, the most doubtful first, and weigh what is found in them. A function of the query alone.
class OpenNodes {
 public:
  // Forgets what was opened for another query. No allocation once it has been as large.
  void open(const Forest& forest, const ForestConfig& config, const ForestQuery& query);

  // Over all trees.
  double total() const { return total_; }
  // Draws a tree by u, which is uniform again afterwards: its root; total() > 0.
  int draw_root(double& u) const;
  const Choice& choice(int node) const { return nodes_[static_cast<size_t>(node)].choice; }
  static constexpr int kClosed = -1;
  // The child in a lane of an open node, if that is open, too.
  int child(int node, int lane) const { return nodes_[static_cast<size_t>(node)].open[lane]; }
  // A root, which is always open.
  int find_root(NodeId id) const;

 private:
  struct Node {
    Choice choice;
    int open[kWidth];
    int parent, lane;
  };
  // A child that may weigh more than it does, by about this amount at most.
  struct Doubt {
    double amount;
    int node, lane;
    bool operator<(const Doubt& other) const;
  };
  struct Trees {
    const Forest& forest;
    const ForestConfig& config;
    const ForestQuery& query;
  };
  const Choice& add(const Trees& trees, NodeId id, int parent, int lane);

  std::vector<Node> nodes_;  // roots first, parents before their children
  std::vector<Doubt> doubts_;
  size_t roots_ = 0;
  double total_ = 0;
};

// Draws of one query: from the roots down to an edge. Where a draw comes by nodes that the one
// before it came by, their weights are known, so that draws in the order of the trees weigh no node
// twice.
class ForestWalk {
 public:
  // Where a draw ends: an edge, not yet tested, in a lane of an edge node; no node if it ends
  // before.
  struct End {
    const EdgeNode* node = nullptr;
    int lane = 0;
    double probability = 1;
    double rest = 0;  // uniform in [0, 1), whatever the edge
    EdgeRef edge() const { return node->edge_at(lane); }
  };
  // All are kept.
  void begin(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
             const OpenNodes& open);
  // By the uniform number u.
  End draw(double u);

 private:
  const Choice& choice(size_t depth, NodeId id);

  const Forest* forest_ = nullptr;
  const ForestConfig* config_ = nullptr;
  const ForestQuery* query_ = nullptr;
  const OpenNodes* open_ = nullptr;
  std::vector<Choice> way_;  // of the last draw that came so deep, by depth
};

}  // namespace limn
