// Choices of the edge forest: weights, two-level importance, node expansion.
#include "edgetree/forest/forest_choice.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <tuple>

namespace limn {
namespace {

// Lobes with a larger det(M^-1) count as narrow. For wider ones node expansion costs what it gains:
// error times time of the CAD part is 1.2 times as high.
constexpr double kNarrow = 50;
// Node expansion: children are expanded if their weight may be too small by this factor, and by
// this share of the total. With 3, 0.3 and twelve nodes errors are equal within noise, and runs
// take a tenth longer.
constexpr float kUncertain = 6;
constexpr double kShare = 1;
// Children with two-level importance use the weights of all their own children if their weight may
// be too small by this factor. Without it, error times time is 1.4 times as high for the harp and
// 1.1 for the plant; with 10, 0.8 and 1.0, but 1.09 for the scene in view.
constexpr float kFarOff = 3;

void look_ahead(const Forest& forest, const ForestConfig& config, const InnerNode& node,
                const ForestPoint& point, ChildWeights& children) {
  for (uint32_t lanes = bits(children.rest > 0) & node.ahead; lanes != 0; lanes &= lanes - 1) {
    const int lane = std::countr_zero(lanes);
    const NodeId child = node.child[lane];
    const float unit = node.head.inverse_radius;
    children.length[lane] =
        child < 0 ? length_below(forest.edges[~child], point, unit)
                  : length_below(forest.inner[child], point, config.soft_weights, unit);
  }
}

}  // namespace

Choice::Choice(NodeId id, Floats w) : node(id) {
  std::memcpy(weights, &w, sizeof weights);
  add_up();
}

void Choice::set(int lane, double weight) {
  weights[lane] = static_cast<float>(weight);
  add_up();
}

void Choice::add_up() {
  static_assert(kWidth == 8);
  for (int i = 0; i < 4; ++i) pairs[i] = static_cast<double>(weights[2 * i]) + weights[2 * i + 1];
  for (int i = 0; i < 2; ++i) fours[i] = pairs[2 * i] + pairs[2 * i + 1];
  total = fours[0] + fours[1];
}

// Binary search without branches, which would be unpredictable.
int Choice::draw(double& u) const {
  double rest = u * total;
  int lane = 0;
  const auto step = [&](double left, int half) {
    const int right = rest >= left;
    rest -= left * right;
    lane += half * right;
  };
  step(fours[0], 4);
  step(pairs[lane / 2], 2);
  step(weights[lane], 1);
  while (!(weights[lane] > 0)) lane = (lane + kWidth - 1) % kWidth;  // rounding
  u = below_one(rest / weights[lane]);
  return lane;
}

Choice choice_at(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
                 NodeId id, Floats* uncertainty) {
  forest.fetch(id);  // all cache lines at once
  if (id < 0) {
    if (uncertainty) *uncertainty = Floats{};
    return {id, weigh_edges(forest.edges[~id], query)};
  }
  const InnerNode& node = forest.inner[id];
  Floats uncertainties{};
  ChildWeights children = weigh_children(node, query, config.soft_weights,
                                         config.most_open > 0 ? &uncertainties : nullptr);
  look_ahead(forest, config, node, query.point, children);
  Floats weights = children.product();
  const Ints far_off = (weights > 0) & (uncertainties > kFarOff);
  for (uint32_t lanes = bits(far_off) & node.ahead; lanes != 0; lanes &= lanes - 1) {
    const int lane = std::countr_zero(lanes);
    const NodeId child = node.child[lane];
    if (child < 0) {
      weights[lane] = sum(weigh_edges(forest.edges[~child], query));
      uncertainties[lane] = 0;
    } else {
      weights[lane] =
          sum(weigh_children(forest.inner[child], query, config.soft_weights).product());
    }
  }
  if (uncertainty) *uncertainty = uncertainties;
  return {id, weights};
}

bool ExpandedNodes::Uncertainty::operator<(const Uncertainty& other) const {
  return std::tie(amount, other.node, other.lane) < std::tie(other.amount, node, lane);
}

const Choice& ExpandedNodes::add(const Trees& trees, NodeId id, int parent, int lane) {
  Floats uncertainty;
  const int index = static_cast<int>(nodes_.size());
  Node& node = nodes_.emplace_back();
  node.choice = choice_at(trees.forest, trees.config, trees.query, id, &uncertainty);
  std::fill(std::begin(node.expanded), std::end(node.expanded), kNotExpanded);
  node.parent = parent;
  node.lane = lane;
  for (int i = 0; i < kWidth; ++i) {
    const double weight = node.choice.weights[i];
    if (!(weight > 0) || !(uncertainty[i] > kUncertain)) continue;
    uncertain_.push_back({weight * (uncertainty[i] - 1.0), index, i});
    std::push_heap(uncertain_.begin(), uncertain_.end());
  }
  return node.choice;
}

void ExpandedNodes::expand(const Forest& forest, const ForestConfig& config,
                           const ForestQuery& query) {
  const Trees trees{forest, config, query};
  nodes_.clear();
  uncertain_.clear();
  double sum = 0;
  for (const NodeId root : forest.roots_for(query.at_rest))
    sum += add(trees, root, kNotExpanded, 0).total;
  roots_ = nodes_.size();
  const int most = query.lobe.det() > kNarrow ? config.most_open : 0;
  const auto child_of = [&](const Uncertainty& uncertainty) {
    return forest.inner[choice(uncertainty.node).node].child[uncertainty.lane];
  };
  for (int i = 0; i < most && !uncertain_.empty(); ++i) {
    const Uncertainty uncertainty = uncertain_.front();
    if (!(uncertainty.amount > kShare * sum)) break;
    std::pop_heap(uncertain_.begin(), uncertain_.end());
    uncertain_.pop_back();
    if (!uncertain_.empty()) forest.fetch(child_of(uncertain_.front()));  // probably expanded next
    sum -= choice(uncertainty.node).weights[uncertainty.lane];
    const NodeId child = child_of(uncertainty);
    nodes_[static_cast<size_t>(uncertainty.node)].expanded[uncertainty.lane] =
        static_cast<int>(nodes_.size());
    sum += add(trees, child, uncertainty.node, uncertainty.lane).total;
  }
  for (size_t i = nodes_.size(); i-- > roots_;) {
    nodes_[static_cast<size_t>(nodes_[i].parent)].choice.set(nodes_[i].lane,
                                                             nodes_[i].choice.total);
  }
  total_ = 0;
  for (size_t i = 0; i < roots_; ++i) total_ += nodes_[i].choice.total;
}

int ExpandedNodes::draw_root(double& u) const {
  double rest = u * total_, weight = 0;
  int root = 0;
  for (size_t i = 0; i < roots_; ++i) {
    if (!(nodes_[i].choice.total > 0)) continue;
    root = static_cast<int>(i);
    weight = nodes_[i].choice.total;
    if (rest < weight) break;
    if (i + 1 < roots_) rest -= weight;
  }
  u = below_one(rest / weight);
  return root;
}

int ExpandedNodes::find_root(NodeId id) const {
  const auto begin = nodes_.begin(), end = begin + static_cast<std::ptrdiff_t>(roots_);
  const auto found = std::find_if(begin, end, [&](const Node& n) { return n.choice.node == id; });
  return found == end ? kNotExpanded : static_cast<int>(found - begin);
}

void ForestWalk::begin(const Forest& forest, const ForestConfig& config, const ForestQuery& query,
                       const ExpandedNodes& expanded) {
  forest_ = &forest;
  config_ = &config;
  query_ = &query;
  expanded_ = &expanded;
  for (Choice& known : way_) known.node = kNoChild;
}

// The reference is valid until the next call.
const Choice& ForestWalk::choice(size_t depth, NodeId id) {
  if (depth >= way_.size()) way_.resize(depth + 1);
  Choice& known = way_[depth];
  if (known.node != id) known = choice_at(*forest_, *config_, *query_, id);
  return known;
}

ForestWalk::End ForestWalk::draw(double u) {
  End end;
  if (!(expanded_->total() > 0)) return end;
  int expanded = expanded_->draw_root(u);
  const Choice* choice = &expanded_->choice(expanded);
  double scale = expanded_->total();
  for (size_t depth = 0;; ++depth) {
    const int lane = choice->draw(u);
    end.probability *= choice->weights[lane] / scale;
    if (choice->node < 0) {
      end.node = &forest_->edges[~choice->node];
      end.lane = lane;
      end.rest = u;
      return end;
    }
    const NodeId child = forest_->inner[choice->node].child[lane];
    if (expanded != ExpandedNodes::kNotExpanded) expanded = expanded_->child(expanded, lane);
    choice = expanded != ExpandedNodes::kNotExpanded ? &expanded_->choice(expanded)
                                                     : &this->choice(depth, child);
    scale = choice->total;
    if (!(scale > 0)) return end;
  }
}

}  // namespace limn
