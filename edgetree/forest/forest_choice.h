#pragma once
// The choice among a node's children: by their weights, and by node expansion where a weight is
// uncertain.
#include <vector>

#include "edgetree/bounds/forest_config.h"
#include "edgetree/forest/choose_root.h"
#include "edgetree/forest/forest_query.h"

namespace limn {

// A node, the weights of its children, and their sums in pairs, in fours and in total.
struct Choice {
  NodeId node = kNoChild;
  float weights[kWidth];
  double pairs[4], fours[2], total = 0;

  Choice() = default;
  Choice(NodeId id, Floats w);
  void set(int lane, double weight);

  // Draws a child by the uniform number u, which is rescaled to be uniform again; total > 0.
  int draw(double& u) const;

 private:
  void add_up();
};

// Weights the children, with two-level importance as configured. uncertainty: see weigh_children,
// for inner nodes; zero for edges.
Choice choice_at(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
                 NodeId id, Floats* uncertainty = nullptr);

// The expanded nodes at the top of the trees for one query. The weight of a wide box is uncertain
// if a narrow lobe may miss most of its content, or if p is near. The most uncertain children are
// expanded first, and get the total weight of their own children. A function of the query alone.
class ExpandedNodes {
 public:
  // Expands nodes for a new query. Reuses memory.
  void expand(const Forest& forest, const ForestConfig& config, const ForestQuery& query);

  // Total weight over all trees.
  double total() const { return total_; }
  // Draws a root by u, which is rescaled to be uniform again; total() > 0.
  int draw_root(double& u) const;
  const Choice& choice(int node) const { return nodes_[static_cast<size_t>(node)].choice; }
  static constexpr int kNotExpanded = -1;
  // The expanded node of a child, or kNotExpanded.
  int child(int node, int lane) const { return nodes_[static_cast<size_t>(node)].expanded[lane]; }
  // A root: they are always expanded, but for those without an edge that moves: kNotExpanded.
  int find_root(NodeId id) const;

 private:
  struct Node {
    Choice choice;
    int expanded[kWidth];
    int parent, lane;
  };
  // A child whose weight may be too small, by up to about this amount.
  struct Uncertainty {
    double amount;
    int node, lane;
    bool operator<(const Uncertainty& other) const;
  };
  struct Trees {
    const Forest& forest;
    const ForestConfig& config;
    const ForestQuery& query;
  };
  const Choice& add(const Trees& trees, NodeId id, int parent, int lane);

  std::vector<Node> nodes_;  // roots first, parents before children
  std::vector<Uncertainty> uncertain_;
  size_t roots_ = 0;
  double total_ = 0;
};

// Draws of one query: descents from the roots to an edge. Weights of nodes that
// the previous draw visited are reused, so draws in tree order weigh no node
// twice.
class ForestWalk {
 public:
  // The end of a descent: an edge, not yet tested, as child `lane` of an edge node; no node if
  // rejected.
  struct End {
    const EdgeNode* node = nullptr;
    int lane = 0;
    double probability = 1;
    double rest = 0;  // uniform in [0, 1), independent of the edge
    EdgeRef edge() const { return node->edge_at(lane); }
  };
  // Keeps references to all arguments.
  void begin(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
             const ExpandedNodes& expanded);
  // By the uniform number u.
  End draw(double u);

 private:
  const Choice& choice(size_t depth, NodeId id);

  const Forest* forest_ = nullptr;
  const ForestConfig* config_ = nullptr;
  const ForestQuery* query_ = nullptr;
  const ExpandedNodes* expanded_ = nullptr;
  std::vector<Choice> way_;  // choices of the last descent, by depth
};

}  // namespace limn
