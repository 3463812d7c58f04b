// Builds the paper's trees per object and group: frames, moments bottom-up, fits, links.
#include "edgetree/quadric/quadric_node.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "edgetree/forest/forest_build.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

constexpr float kInfinite = std::numeric_limits<float>::infinity();
// Weight of flat edges, for points on their plane. Not tuned.
constexpr double kFlat = 0x1.0p-12;

// Edges that are always candidates have the full angle, silhouettes their dihedral angle.
double weight_of(const Wedge& wedge, ForestGroup group) {
  const bool turns = group == ForestGroup::kSilhouette;
  return wedge.length * (turns ? std::max(wedge.angle, kPi * kFlat) : kPi);
}

// Data of a node that its parent needs.
struct Summary {
  NodeFrame frame;
  PlaneMoments moments;  // in that frame
};

// Fills the nodes of one tree. ids: of the tree's nodes in the forest.
class Filler {
 public:
  Filler(const QuadricShape& shape, std::span<const NodeId> ids, std::span<const Wedge> wedges,
         ShapeId object, ForestGroup group, const QuadricConfig& config, QuadricForest& forest)
      : shape_(shape),
        ids_(ids),
        wedges_(wedges),
        object_(object),
        group_(group),
        quadrics_(config.quadrics && group == ForestGroup::kSilhouette),
        forest_(forest) {}

  void fill(int threads) {
    const size_t parts = shape_.parts.size() - 1;
    const uint32_t top = shape_.parts[0];
    std::vector<Summary> first(parts);  // of the parts' first nodes
    parallel_for(parts, threads, [&](size_t i) {
      const uint32_t begin = shape_.parts[i], end = shape_.parts[i + 1];
      std::vector<Summary> summaries(end - begin);
      const auto of = [&](uint32_t node) -> const Summary& { return summaries[node - begin]; };
      for (uint32_t node = end; node-- > begin;) {
        summaries[node - begin] = summary(node, of);
        fill_node(node, of);
      }
      first[i] = summaries[0];
    });
    std::vector<Summary> above(top);
    const auto of = [&](uint32_t node) -> const Summary& {
      if (node < top) return above[node];
      const auto part = std::lower_bound(shape_.parts.begin(), shape_.parts.end(), node);
      return first[part - shape_.parts.begin()];
    };
    for (uint32_t node = top; node-- > 0;) above[node] = summary(node, of);
    parallel_for(top, threads, [&](size_t node) { fill_node(static_cast<uint32_t>(node), of); });
  }

 private:
  std::span<const Wedge> edges(EdgeRange range) const {
    return wedges_.subspan(range.begin, range.size());
  }

  // of: summaries of the children.
  template <class Of>
  Summary summary(uint32_t index, const Of& of) const {
    const SplitNode<kQuadricWidth>& split = shape_.nodes[index];
    Summary result;
    result.frame = frame_of(bounds_of(edges(split.range)));
    if (!quadrics_) return result;
    if (split.has_edges) {
      result.moments = moments_of(edges(split.range), result.frame);
      return result;
    }
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      if (split.ranges[lane].size() == 0) continue;
      const Summary& child = of(split.children[lane]);
      result.moments.add(child.moments, child.frame, result.frame);
    }
    return result;
  }

  template <class Of>
  void fill_node(uint32_t index, const Of& of) {
    const SplitNode<kQuadricWidth>& split = shape_.nodes[index];
    if (split.has_edges) {
      QuadricLeaf& leaf = forest_.leaves[~ids_[index]];
      leaf.object = object_;
      leaf.group = group_;
      for (uint32_t lane = 0; lane < kQuadricWidth; ++lane)
        leaf.edge[lane] = lane < split.range.size()
                              ? static_cast<int32_t>(wedges_[split.range.begin + lane].edge.index())
                              : kNoChild;
      return;
    }
    QuadricNode& node = forest_.nodes[ids_[index]];
    const NodeFrame frame = frame_of(bounds_of(edges(split.range)));
    node.object = object_;
    node.group = group_;
    for (int k = 0; k < 3; ++k) node.origin[k] = static_cast<float>(frame.center[k]);
    node.inverse_radius = static_cast<float>(frame.inverse_radius);
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      const std::span<const Wedge> wedges = edges(split.ranges[lane]);
      node.child[lane] = wedges.empty() ? kNoChild : ids_[split.children[lane]];
      if (wedges.empty()) {
        put_fit(unrejectable_quadric_fit(), ids_[index], lane);
        continue;
      }
      put_fit(fit(wedges, frame, of(split.children[lane])), ids_[index], lane);
      put_box(bounds_of(wedges), frame, lane, node);
      double weight = 0;
      for (const Wedge& wedge : wedges) weight += weight_of(wedge, group_);
      node.weight[lane] = static_cast<float>(
          std::max(weight * frame.inverse_radius, double{std::numeric_limits<float>::min()}));
    }
  }

  QuadricFit fit(std::span<const Wedge> wedges, const NodeFrame& frame,
                 const Summary& child) const {
    if (rejects_none(group_)) return unrejectable_quadric_fit();
    return fit_quadrics(wedges, frame, quadrics_ ? &child.moments : nullptr, child.frame);
  }

  void put_fit(const QuadricFit& fit, NodeId id, int lane) {
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k)
        forest_.nodes[id].rows[i][k][lane] = static_cast<float>(fit.rows[i][k]);
    if (forest_.pairs.empty()) return;
    put_pair(fit.pair, lane, forest_.pairs[id]);
  }

  static void put_box(const Bounds& box, const NodeFrame& frame, int lane, QuadricNode& node) {
    for (int k = 0; k < 3; ++k) {
      const double low = (box.lower[k] - frame.center[k]) * frame.inverse_radius;
      const double high = (box.upper[k] - frame.center[k]) * frame.inverse_radius;
      const float center = static_cast<float>(0.5 * (low + high));
      node.center[k][lane] = center;
      // Far above the rounding of the center, whose modulus is at most 1.
      const double half = std::max(high - center, center - low) + 0x1.0p-20;
      node.half[k][lane] = std::nextafter(static_cast<float>(half), kInfinite);
    }
  }

  const QuadricShape& shape_;
  std::span<const NodeId> ids_;
  std::span<const Wedge> wedges_;
  ShapeId object_;
  ForestGroup group_;
  bool quadrics_;
  QuadricForest& forest_;
};

// Allocates the nodes of a tree; returns the ids.
std::vector<NodeId> append_nodes(const QuadricShape& shape, bool quadrics, QuadricForest& forest) {
  std::vector<NodeId> ids(shape.nodes.size());
  auto nodes = static_cast<NodeId>(forest.nodes.size());
  auto leaves = static_cast<NodeId>(forest.leaves.size());
  for (size_t i = 0; i < ids.size(); ++i) ids[i] = shape.nodes[i].has_edges ? ~leaves++ : nodes++;
  forest.nodes.resize(nodes);
  forest.leaves.resize(leaves);
  if (quadrics) forest.pairs.resize(nodes);
  forest.roots.push_back(ids[0]);
  return ids;
}

// Sets parents of nodes and slots of edges for new nodes.
void link(std::span<const NodeId> ids, QuadricForest& forest) {
  const auto set_parent = [&](NodeId id, uint32_t slot) {
    (id < 0 ? forest.leaves[~id].parent : forest.nodes[id].parent) = slot;
  };
  set_parent(ids[0], kNoParent);
  for (const NodeId id : ids)
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      const int32_t child = forest.lanes(id)[lane];
      if (child == kNoChild) continue;
      const uint32_t slot = kQuadricWidth * static_cast<uint32_t>(id < 0 ? ~id : id) + lane;
      if (id < 0)
        forest.slots[forest.leaves[~id].object.index()][child] = slot;
      else
        set_parent(child, slot);
    }
}

void append_tree(const WedgeList& list, ShapeId object, ForestGroup group, int threads,
                 const QuadricConfig& config, QuadricForest& forest) {
  WedgeWindow window(list);
  const std::span<const Wedge> wedges = window.wedges({0, static_cast<uint32_t>(list.size())});
  const QuadricShape shape = shape_of(wedges, threads);
  std::vector<Wedge> sorted(wedges.size());
  for (size_t i = 0; i < wedges.size(); ++i) sorted[i] = wedges[shape.order[i]];
  const std::vector<NodeId> ids = append_nodes(shape, config.quadrics, forest);
  Filler(shape, ids, sorted, object, group, config, forest).fill(threads);
  link(ids, forest);
}

}  // namespace

uint64_t QuadricForest::bytes() const {
  uint64_t sum = nodes.size() * sizeof(QuadricNode) + pairs.size() * sizeof(QuadricPairs) +
                 leaves.size() * sizeof(QuadricLeaf) + roots.size() * sizeof(NodeId);
  for (const auto& object : slots) sum += object.size() * sizeof(uint32_t);
  return sum;
}

QuadricForest build_quadric_forest(const EdgeSamplerInput& input, int threads,
                                   const QuadricConfig& config) {
  QuadricForest forest;
  for_every_tree(input, config.cull_concave, forest,
                 [&](const WedgeList& list, ShapeId object, ForestGroup group) {
                   append_tree(list, object, group, threads, config, forest);
                 });
  return forest;
}

}  // namespace limn
