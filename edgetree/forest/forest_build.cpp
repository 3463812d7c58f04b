// Builds one tree per object and group: groups, node frames, heights, links.
#include "edgetree/forest/forest_build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>
#include <utility>

#include "edgetree/forest/forest_query.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// Keeps the 24 leading bits, so that the number is a float. Casts to float and back are not used,
// because GCC 12 drops them when it vectorises.
double truncated(double x) {
  return std::bit_cast<double>(std::bit_cast<uint64_t>(x) & ~((uint64_t{1} << 29) - 1));
}

double length_of(std::span<const Wedge> wedges) {
  double sum = 0;
  for (const Wedge& wedge : wedges) sum += wedge.length;
  return sum;
}

float positive(double x) {
  return static_cast<float>(std::max(x, double{std::numeric_limits<float>::min()}));
}

double folds_of(std::span<const Wedge> wedges) {
  double sum = 0;
  for (const Wedge& wedge : wedges) sum += wedge.length * wedge.fold;
  return sum;
}

// Nonzero motion must not underflow.
float speed_of(std::span<const Wedge> wedges) {
  double speed = 0;
  for (const Wedge& wedge : wedges) speed += wedge.length * wedge.speed;
  return speed > 0 ? positive(speed / length_of(wedges)) : 0;
}

// Rounds a box outward to a step.
void put_box(const Bounds& box, const NodeFrame& frame, int lane, InnerNode& node) {
  constexpr double kMargin = 0x1.0p-16;  // in steps, above the rounding of a query
  const auto step = [](double x) {
    return static_cast<int32_t>(std::clamp(x, 0.0, double{kBoxSteps}));
  };
  int32_t packed_low = 0, packed_high = 0;
  for (int k = 0; k < 3; ++k) {
    const double low = (box.lower[k] - frame.center[k]) * frame.inverse_radius;
    const double high = (box.upper[k] - frame.center[k]) * frame.inverse_radius;
    packed_low |= step(std::floor((low + 1) * 0.5 * kBoxSteps - kMargin)) << (k * kBoxBits);
    packed_high |= step(std::ceil((high + 1) * 0.5 * kBoxSteps + kMargin)) << (k * kBoxBits);
  }
  node.low[lane] = packed_low;
  node.high[lane] = packed_high;
}

template <class Rows>
void put_rows(const DualFit& fit, int lane, Rows& rows) {
  for (size_t i = 0; i < std::size(rows); ++i)
    for (int k = 0; k < 4; ++k) rows[i][k][lane] = static_cast<float>(fit.rows[i][k]);
}

// What the nodes of one tree share.
struct TreeKind {
  ShapeId object;
  uint32_t motion;
  ForestGroup group;
  float fold = 1;  // see NodeHead
};

// Fills the nodes of one tree, in one thread. ids: of the tree's nodes in the forest. below: the
// trees for which the wedges stand, or none.
class TreeFiller {
 public:
  TreeFiller(const ForestShape& tree, std::span<const NodeId> ids, const WedgeList& list,
             std::span<const NodeId> below, const TreeKind& kind, const ForestConfig& config)
      : tree_(tree),
        ids_(ids),
        list_(list),
        window_(list),
        below_(below),
        kind_(kind),
        config_(config) {}

  void fill(uint32_t index, Forest& forest) {
    const SplitNode<kWidth>& split = tree_.nodes[index];
    const bool small = split.range.size() <= kWindow;
    const NodeFrame frame =
        frame_of(small ? bounds_of(edges(split.range)) : list_.bounds(split.range));
    if (ids_[index] < 0) {
      EdgeNode& node = *std::construct_at(&forest.edges[~ids_[index]]);
      fill_head(frame, node.head);
      fill_edges(split, frame, node);
    } else {
      InnerNode& node = *std::construct_at(&forest.inner[ids_[index]]);
      fill_head(frame, node.head);
      fill_children(split, frame, node);
    }
  }

 private:
  // Whole wedges of at most so many edges are made once, for all nodes over them.
  static constexpr uint32_t kWindow = 4096;  // not tuned

  std::span<const Wedge> edges(EdgeRange range) { return window_.wedges(range); }

  // All fields but the parent.
  void fill_head(const NodeFrame& frame, NodeHead& head) const {
    for (int k = 0; k < 3; ++k) head.center[k] = static_cast<float>(frame.center[k]);
    head.inverse_radius = static_cast<float>(frame.inverse_radius);
    head.object = kind_.object;
    head.motion = kind_.motion;
    head.group = kind_.group;
    head.fold = kind_.fold;
  }

  DualFit fit(std::span<const Wedge> wedges, const NodeFrame& frame) {
    if (kind_.group == ForestGroup::kAlways) return unrejectable_fit(length_of(wedges));
    if (kind_.group == ForestGroup::kSilhouette) return fit_dual(wedges, frame, config_);
    // A fold counts `folds` of the node; a silhouette counts this much more.
    rest_.assign(wedges.begin(), wedges.end());
    for (Wedge& wedge : rest_) wedge.length *= 1 - wedge.fold;
    return fit_dual(rest_, frame, config_);
  }

  void fill_children(const SplitNode<kWidth>& split, const NodeFrame& frame, InnerNode& node) {
    node.child = Ints{} + kNoChild;
    const double scale = frame.inverse_radius * frame.inverse_radius;
    for (int lane = 0; lane < kWidth; ++lane) {
      const std::span<const Wedge> wedges = edges(split.ranges[lane]);
      const DualFit dual = wedges.empty() ? DualFit{} : fit(wedges, frame);
      if (wedges.empty()) continue;
      put_rows(dual, lane, node.rows);
      for (int k = 0; k < 3; ++k) node.cover[k][lane] = positive(dual.cover[k] * scale);
      node.folds[lane] = positive(folds_of(wedges) * scale);
      node.speed[lane] = speed_of(wedges);
      node.child[lane] =
          split.has_edges ? below_[split.ranges[lane].begin] : ids_[split.children[lane]];
      put_box(bounds_of(wedges), frame, lane, node);
    }
  }

  void fill_edges(const SplitNode<kWidth>& split, const NodeFrame& frame, EdgeNode& node) {
    node.edge = Ints{} + kNoChild;
    const double scale = frame.inverse_radius * frame.inverse_radius;
    for (int lane = 0; lane < kWidth; ++lane) {
      const std::span<const Wedge> wedges = edges(split.ranges[lane]);
      if (wedges.empty()) continue;
      put_rows(fit_edge(wedges[0], frame), lane, node.rows);
      node.length[lane] = positive(wedges[0].length * scale);
      node.speed[lane] = speed_of(wedges);
      node.edge[lane] = static_cast<int32_t>(wedges[0].edge.index());
      for (int e = 0; e < 2; ++e)
        for (int k = 0; k < 3; ++k)
          node.ends[e][k][lane] = static_cast<float>(wedges[0].ends[e][k]);
    }
  }

  const ForestShape& tree_;
  std::span<const NodeId> ids_;
  const WedgeList& list_;
  WedgeWindow window_;
  std::span<const NodeId> below_;
  TreeKind kind_;
  const ForestConfig& config_;
  std::vector<Wedge> rest_;
};

// Allocates the nodes of a tree of edges, or above other trees; returns their ids.
std::vector<NodeId> append_nodes(const ForestShape& tree, bool of_edges, Forest& forest) {
  std::vector<NodeId> ids(tree.nodes.size());
  auto inner = static_cast<NodeId>(forest.inner.size());
  auto edges = static_cast<NodeId>(forest.edges.size());
  for (size_t i = 0; i < ids.size(); ++i)
    ids[i] = of_edges && tree.nodes[i].has_edges ? ~edges++ : inner++;
  forest.inner.resize(inner);
  forest.edges.resize(edges);
  return ids;
}

// Computes heights bottom-up, from edge nodes to the root.
void set_heights(std::span<const NodeId> ids, const ForestConfig& config, Forest& forest) {
  for (size_t i = ids.size(); i-- > 0;) {
    if (ids[i] < 0) {
      forest.head(ids[i]).height = 0;
      continue;
    }
    InnerNode& node = forest.inner[ids[i]];
    node.ahead = 0;
    int highest = 0;
    for (int lane = 0; lane < kWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const int height = forest.head(node.child[lane]).height;
      highest = std::max(highest, height);
      if (height <= config.look_ahead) node.ahead |= static_cast<uint8_t>(1 << lane);
    }
    node.head.height = static_cast<uint8_t>(std::min(highest + 1, 255));
  }
}

// Sets parents of nodes and slots of edges for new nodes.
void link(std::span<const NodeId> ids, Forest& forest) {
  forest.head(ids[0]).parent = kNoParent;
  for (const NodeId id : ids)
    for (int lane = 0; lane < kWidth; ++lane) {
      const uint32_t slot = kWidth * static_cast<uint32_t>(id < 0 ? ~id : id) + lane;
      const int32_t child = id < 0 ? forest.edges[~id].edge[lane] : forest.inner[id].child[lane];
      if (child == kNoChild) continue;
      if (id < 0)
        forest.slots[forest.edges[~id].head.object.index()][child] = slot;
      else
        forest.head(child).parent = slot;
    }
}

// Appends a tree over wedges, which it reorders, or above the trees for which they stand. Returns
// its root.
NodeId append_tree(WedgeList& list, std::span<const NodeId> trees, const TreeKind& kind,
                   int threads, const ForestConfig& config, Forest& forest) {
  ForestShape tree = split_edges(list, config.width, threads);
  std::vector<NodeId> below(trees.size());
  for (size_t i = 0; i < below.size(); ++i) below[i] = trees[tree.order[i]];
  list.put_in_order(std::move(tree.order));
  const std::vector<NodeId> ids = append_nodes(tree, trees.empty(), forest);
  constexpr size_t kBlock = 64;  // nodes; not tuned
  parallel_for((tree.nodes.size() + kBlock - 1) / kBlock, threads, [&](size_t block) {
    TreeFiller filler(tree, ids, list, below, kind, config);
    const size_t end = std::min(tree.nodes.size(), kBlock * (block + 1));
    for (size_t i = kBlock * block; i < end; ++i) filler.fill(static_cast<uint32_t>(i), forest);
  });
  set_heights(ids, config, forest);
  link(ids, forest);
  return ids[0];
}

// Residual speed of a vertex after the object's linear motion, nonzero if the vertex moves.
double speed_of(const EdgeMesh& mesh, VertexId vertex, const Lanes& scale,
                const ObjectMotion& motion) {
  if (mesh.tangents.empty()) return 0;
  const Vec3<Lanes> v = scaled_velocity(mesh.tangent(vertex), scale);
  const double left = sum_of_speeds(v - motion.velocity(mesh.position(vertex)));
  return sum_of_speeds(v) > 0 ? std::max(left, double{std::numeric_limits<float>::min()}) : left;
}

void set_speeds(const EdgeMesh& mesh, const Lanes& scale, const ObjectMotion& motion,
                WedgeList& list) {
  for (size_t i = 0; i < list.size(); ++i) {
    const auto [a, b] = mesh.edge(list.edge(i)).vertices;
    list.set_speed(i, 0.5 * (speed_of(mesh, a, scale, motion) + speed_of(mesh, b, scale, motion)));
  }
}

// The length of an edge times the share of directions from which it is a candidate.
double expected_length(const Wedge& wedge, ForestGroup group) {
  switch (group) {
    case ForestGroup::kSilhouette:
      return wedge.length * wedge.angle / kPi;
    case ForestGroup::kFront:
      return wedge.length * (0.5 * wedge.fold + 0.5 * wedge.angle / kPi);
    case ForestGroup::kFolds:
      return wedge.length * std::max(wedge.fold, wedge.angle / kPi);
    default:
      return wedge.length;
  }
}

// A wedge that stands for a tree: its box is the tree's, its speed that of the edges themselves.
Wedge stand_in(const WedgeList& list, ForestGroup group, const ObjectMotion& motion) {
  const Bounds box = list.bounds();
  Wedge whole;
  whole.ends = {box.lower, box.upper};
  double length = 0;
  for (size_t i = 0; i < list.size(); ++i) {
    const Wedge wedge = list[i];
    const Vec3d middle = (wedge.ends[0] + wedge.ends[1]) * 0.5;
    const double speed = wedge.speed > 0 ? wedge.speed + sum_of_speeds(motion.velocity(middle)) : 0;
    whole.length += expected_length(wedge, group);
    whole.speed += wedge.length * speed;
    length += wedge.length;
  }
  whole.length = positive(whole.length);
  if (whole.speed > 0) whole.speed = positive(whole.speed / length);
  return whole;
}

// The trees of objects and groups.
struct Tree {
  NodeId root;
  Wedge stand_in;
  double radius;
  // Trees of a kind may share a node: those of textures are no outlines, and static ones have no
  // weight for a query at rest.
  int kind;
};
constexpr int kKinds = 4;
Tree tree_of(NodeId root, const Wedge& stand_in, bool of_texture, const Forest& forest) {
  return {root, stand_in, 1 / double{forest.head(root).inverse_radius},
          2 * of_texture + (stand_in.speed > 0)};
}

// A tree that is kept for other forests: its nodes, where they were in the first.
struct KeptTree {
  NodeId inner_begin, edges_begin;
  std::vector<InnerNode> inner;
  std::vector<EdgeNode> edges;
  Wedge stand_in;
};

// The nodes of a forest from these on.
KeptTree kept_tree(const Forest& forest, NodeId inner, NodeId edges, const Wedge& stand_in) {
  return {inner,
          edges,
          {forest.inner.begin() + inner, forest.inner.end()},
          {forest.edges.begin() + edges, forest.edges.end()},
          stand_in};
}

// Appends a tree whose object has this motion; returns its root.
NodeId append_kept(const KeptTree& tree, uint32_t motion, Forest& forest) {
  const auto inner = static_cast<NodeId>(forest.inner.size());
  const auto edges = static_cast<NodeId>(forest.edges.size());
  forest.inner.insert(forest.inner.end(), tree.inner.begin(), tree.inner.end());
  forest.edges.insert(forest.edges.end(), tree.edges.begin(), tree.edges.end());
  std::vector<NodeId> ids;
  for (auto i = inner; i < static_cast<NodeId>(forest.inner.size()); ++i) {
    ids.push_back(i);
    for (int lane = 0; lane < kWidth; ++lane) {
      const NodeId child = forest.inner[i].child[lane];
      if (child == kNoChild) continue;
      forest.inner[i].child[lane] +=
          child < 0 ? tree.edges_begin - edges : inner - tree.inner_begin;
    }
  }
  for (auto i = edges; i < static_cast<NodeId>(forest.edges.size()); ++i) ids.push_back(~i);
  for (const NodeId id : ids) forest.head(id).motion = motion;
  link(ids, forest);
  return ids[0];
}

// More trees of a kind get nodes above them. Not tuned.
constexpr size_t kManyTrees = 32;
// All but the largest: a node over a floor and what stands on it says little of either. Without
// them the variance of `boundary` is 2 to 6 times as high where a thousand small shapes hang over a
// floor; 4 to 32 differ by less than the noise.
constexpr size_t kApart = 8;

// Appends the roots of a kind's trees, or of the nodes above them.
void append_roots(std::span<const Tree> all, int kind, int threads, const ForestConfig& config,
                  Forest& forest) {
  std::vector<const Tree*> trees;
  for (const Tree& tree : all)
    if (tree.kind == kind) trees.push_back(&tree);
  std::ranges::stable_sort(trees,
                           [](const Tree* a, const Tree* b) { return a->radius > b->radius; });
  for (size_t i = 0; i < std::min(kApart, trees.size()); ++i)
    forest.roots.push_back(trees[i]->root);
  std::vector<NodeId> below;
  std::vector<Wedge> stand_ins;
  for (size_t i = kApart; i < trees.size(); ++i) {
    below.push_back(trees[i]->root);
    stand_ins.push_back(trees[i]->stand_in);
  }
  const TreeKind tree{forest.head(below[0]).object, 0, ForestGroup::kAlways};
  WedgeList list(std::move(stand_ins));
  forest.roots.push_back(append_tree(list, below, tree, threads, config, forest));
}
void append_roots(std::span<const Tree> trees, int threads, const ForestConfig& config,
                  Forest& forest) {
  size_t count[kKinds] = {};
  for (const Tree& tree : trees) ++count[tree.kind];
  for (const Tree& tree : trees)
    if (count[tree.kind] <= kManyTrees) forest.roots.push_back(tree.root);
  for (int kind = 0; kind < kKinds; ++kind)
    if (count[kind] > kManyTrees) append_roots(trees, kind, threads, config, forest);
}

// Appends the motion of an object, unless it is static; returns its index.
uint32_t append_motion(const EdgeMesh& mesh, const Lanes& lane_scale, Forest& forest) {
  const ObjectMotion motion = motion_of(mesh, lane_scale);
  double speed = sum_of_speeds(motion.at_center);
  for (const Vec3<Lanes>& column : motion.linear) speed += sum_of_speeds(column);
  if (speed == 0) return 0;
  forest.motions.push_back(motion);
  return static_cast<uint32_t>(forest.motions.size() - 1);
}

}  // namespace

struct KeptTrees {
  std::vector<std::vector<KeptTree>> objects;  // the trees of each object
};

// The trees of an object that are kept, or to be kept; null: it is not shared.
static std::vector<KeptTree>* kept_of(SharedObjects* shared, ShapeId object) {
  if (!shared || object.index() >= shared->same.size() || !shared->same[object.index()]) {
    return nullptr;
  }
  if (!shared->trees) shared->trees = std::make_shared<KeptTrees>();
  shared->trees->objects.resize(shared->same.size());
  return &shared->trees->objects[object.index()];
}

size_t expected_edge_nodes(const EdgeSamplerInput& input) {
  size_t edges = 0;
  for (const EdgeMesh& mesh : input.objects) edges += mesh.edges.size();
  return edges * 4 / (3 * kWidth) + input.objects.size();
}

std::optional<ForestGroup> group_of(const EdgeMesh& mesh, const Edge& edge, bool cull_concave) {
  switch (edge.edge_class) {
    case EdgeClass::kSmooth:
    case EdgeClass::kFlat:
      if (cull_concave && edge.concave && mesh.one_sided_closed) return std::nullopt;
      return ForestGroup::kSilhouette;
    case EdgeClass::kSharp:
      return mesh.one_sided_closed ? ForestGroup::kFront : ForestGroup::kFolds;
    case EdgeClass::kTexture:
      return mesh.one_sided_closed ? ForestGroup::kFront : ForestGroup::kAlways;
    default:
      return ForestGroup::kAlways;
  }
}

Bounds bounds_of(std::span<const Wedge> wedges) {
  Bounds bounds;
  for (const Wedge& wedge : wedges)
    for (const Vec3d& x : wedge.ends) bounds.extend(x);
  return bounds;
}

// The cube around the center contains the box: boxes of children are clipped to it.
NodeFrame frame_of(const Bounds& box) {
  const Vec3d middle = box.center();
  const Vec3d center{truncated(middle.x), truncated(middle.y), truncated(middle.z)};
  double radius = 0.5 * box.diagonal();
  // Covers the rounding of the center and the diagonal of thin boxes.
  for (int k = 0; k < 3; ++k)
    radius = std::max({radius, box.upper[k] - center[k], center[k] - box.lower[k]});
  return {center, truncated(1 / radius)};
}

Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config,
                    SharedObjects* shared) {
  Forest forest;
  // To grow, a vector holds its elements twice. Room that is not used takes no memory.
  forest.edges.reserve(expected_edge_nodes(input));
  forest.inner.reserve(expected_edge_nodes(input) / 2);
  forest.motions.emplace_back();
  std::vector<uint32_t> motions;
  for (const EdgeMesh& mesh : input.objects)
    motions.push_back(append_motion(mesh, input.lane_scale, forest));
  std::vector<Tree> trees;
  const auto append = [&](WedgeList& list, ShapeId object, ForestGroup group) {
    const EdgeMesh& mesh = input.object(object);
    const TreeKind kind{object, motions[object.index()], group, mesh.fold_contrast};
    const ObjectMotion motion = forest.motions[kind.motion];
    set_speeds(mesh, input.lane_scale, motion, list);
    const Wedge whole = stand_in(list, group, motion);
    const auto inner = static_cast<NodeId>(forest.inner.size());
    const auto edges = static_cast<NodeId>(forest.edges.size());
    const NodeId root = append_tree(list, {}, kind, threads, config, forest);
    trees.push_back(tree_of(root, whole, mesh.of_texture(), forest));
    if (std::vector<KeptTree>* kept = kept_of(shared, object)) {
      kept->push_back(kept_tree(forest, inner, edges, whole));
    }
  };
  for (uint32_t o = 0; o < input.objects.size(); ++o) {
    const EdgeMesh& mesh = input.objects[o];
    forest.extent = std::max(forest.extent, mesh.extent);
    forest.slots.emplace_back(mesh.edges.size(), kNoParent);
    const std::vector<KeptTree>* const kept = kept_of(shared, ShapeId(o));
    if (!kept || kept->empty()) {
      for_trees_of(mesh, ShapeId(o), config.cull_concave, append);
      continue;
    }
    for (const KeptTree& tree : *kept) {
      const NodeId root = append_kept(tree, motions[o], forest);
      trees.push_back(tree_of(root, tree.stand_in, mesh.of_texture(), forest));
    }
  }
  append_roots(trees, threads, config, forest);
  const auto moves = [&](NodeId root) {
    return bits((root < 0 ? forest.edges[~root].speed : forest.inner[root].speed) > 0) != 0;
  };
  std::ranges::copy_if(forest.roots, std::back_inserter(forest.moving_roots), moves);
  return forest;
}

}  // namespace limn
