// Builds one tree per object and group: groups, node frames, heights, links.
#include "edgetree/forest/forest_build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <limits>

#include "edgetree/forest/forest_query.h"
#include "edgetree/forest/forest_split.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// Keeps the 24 leading bits, so that the number is a float. Casts to float and back are not used,
// because GCC 12 drops them when it vectorises.
double truncated(double x) {
  return std::bit_cast<double>(std::bit_cast<uint64_t>(x) & ~((uint64_t{1} << 29) - 1));
}

}  // namespace

std::optional<ForestGroup> group_of(const EdgeMesh& mesh, const Edge& edge, bool cull_concave) {
  switch (edge.edge_class) {
    case EdgeClass::kSmooth:
    case EdgeClass::kFlat:
      if (cull_concave && edge.concave && mesh.one_sided_closed) return std::nullopt;
      return ForestGroup::kSilhouette;
    case EdgeClass::kSharp:
    case EdgeClass::kTexture:
      return mesh.one_sided_closed ? ForestGroup::kFront : ForestGroup::kAlways;
    default:
      return ForestGroup::kAlways;
  }
}

Wedge wedge_of(const EdgeMesh& mesh, EdgeId id) {
  const Edge& edge = mesh.edge(id);
  const auto [a, b] = edge.vertices;
  Wedge wedge;
  wedge.planes[0] = mesh.plane(edge.faces[0]);
  wedge.planes[1] = edge.faces[1].valid() ? mesh.plane(edge.faces[1]) : wedge.planes[0];
  wedge.ends = {mesh.position(a), mesh.position(b)};
  wedge.length = length(wedge.ends[1] - wedge.ends[0]);
  const Vec3d &n0 = wedge.planes[0].n, &n1 = wedge.planes[1].n;
  wedge.angle = std::atan2(length(cross(n0, n1)), dot(n0, n1));
  wedge.edge = id;
  return wedge;
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

namespace {

double length_of(std::span<const Wedge> wedges) {
  double sum = 0;
  for (const Wedge& wedge : wedges) sum += wedge.length;
  return sum;
}

float positive(double x) {
  return static_cast<float>(std::max(x, double{std::numeric_limits<float>::min()}));
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

// Fills the nodes of one tree independently. ids: of the tree's nodes in the forest.
class TreeFiller {
 public:
  TreeFiller(const ForestShape& tree, std::span<const NodeId> ids, std::span<const Wedge> wedges,
             ShapeId object, ForestGroup group, const ForestConfig& config)
      : tree_(tree), ids_(ids), wedges_(wedges), object_(object), group_(group), config_(config) {}

  void fill(uint32_t index, Forest& forest) const {
    const SplitNode<kWidth>& split = tree_.nodes[index];
    const NodeFrame frame = frame_of(bounds_of(edges(split.range)));
    if (split.has_edges) {
      EdgeNode& node = forest.edges[~ids_[index]];
      fill_head(frame, node.head);
      fill_edges(split, frame, node);
    } else {
      InnerNode& node = forest.inner[ids_[index]];
      fill_head(frame, node.head);
      fill_children(split, frame, node);
    }
  }

 private:
  std::span<const Wedge> edges(EdgeRange range) const {
    return wedges_.subspan(range.begin, range.size());
  }

  // All fields but the parent.
  void fill_head(const NodeFrame& frame, NodeHead& head) const {
    for (int k = 0; k < 3; ++k) head.center[k] = static_cast<float>(frame.center[k]);
    head.inverse_radius = static_cast<float>(frame.inverse_radius);
    head.object = object_;
    head.group = group_;
  }

  DualFit fit(std::span<const Wedge> wedges, const NodeFrame& frame) const {
    if (group_ == ForestGroup::kSilhouette) return fit_dual(wedges, frame, config_);
    const double length = length_of(wedges);
    if (group_ == ForestGroup::kAlways) return unrejectable_fit(length);
    DualFit fit = fit_dual(wedges, frame, config_);
    fit.cover[0] = length;
    return fit;
  }

  void fill_children(const SplitNode<kWidth>& split, const NodeFrame& frame,
                     InnerNode& node) const {
    node.child = Ints{} + kNoChild;
    const double scale = frame.inverse_radius * frame.inverse_radius;
    for (int lane = 0; lane < kWidth; ++lane) {
      const std::span<const Wedge> wedges = edges(split.ranges[lane]);
      const DualFit dual = wedges.empty() ? DualFit{} : fit(wedges, frame);
      if (wedges.empty()) continue;
      put_rows(dual, lane, node.rows);
      for (int k = 0; k < 3; ++k) node.cover[k][lane] = positive(dual.cover[k] * scale);
      node.speed[lane] = speed_of(wedges);
      node.child[lane] = ids_[split.children[lane]];
      put_box(bounds_of(wedges), frame, lane, node);
    }
  }

  void fill_edges(const SplitNode<kWidth>& split, const NodeFrame& frame, EdgeNode& node) const {
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
  std::span<const Wedge> wedges_;
  ShapeId object_;
  ForestGroup group_;
  const ForestConfig& config_;
};

// Allocates the nodes of a tree; returns their ids.
std::vector<NodeId> append_nodes(const ForestShape& tree, Forest& forest) {
  std::vector<NodeId> ids(tree.nodes.size());
  auto inner = static_cast<NodeId>(forest.inner.size());
  auto edges = static_cast<NodeId>(forest.edges.size());
  for (size_t i = 0; i < ids.size(); ++i) ids[i] = tree.nodes[i].has_edges ? ~edges++ : inner++;
  forest.inner.resize(inner);
  forest.edges.resize(edges);
  forest.roots.push_back(ids[0]);
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

void append_tree(std::span<const Wedge> wedges, ShapeId object, ForestGroup group, int threads,
                 const ForestConfig& config, Forest& forest) {
  const ForestShape tree = split_edges(wedges, config.width, threads);
  std::vector<Wedge> sorted(wedges.size());
  parallel_for((wedges.size() + 4095) / 4096, threads, [&](size_t block) {
    for (size_t i = 4096 * block; i < std::min(wedges.size(), 4096 * (block + 1)); ++i)
      sorted[i] = wedges[tree.order[i]];
  });
  const std::vector<NodeId> ids = append_nodes(tree, forest);
  const TreeFiller filler(tree, ids, sorted, object, group, config);
  constexpr size_t kBlock = 64;  // nodes; not tuned
  parallel_for((tree.nodes.size() + kBlock - 1) / kBlock, threads, [&](size_t block) {
    const size_t end = std::min(tree.nodes.size(), kBlock * (block + 1));
    for (size_t i = kBlock * block; i < end; ++i) filler.fill(static_cast<uint32_t>(i), forest);
  });
  set_heights(ids, config, forest);
  link(ids, forest);
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
                std::span<Wedge> wedges) {
  for (Wedge& wedge : wedges) {
    const auto [a, b] = mesh.edge(wedge.edge).vertices;
    wedge.speed = 0.5 * (speed_of(mesh, a, scale, motion) + speed_of(mesh, b, scale, motion));
  }
}

}  // namespace

Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config) {
  Forest forest;
  for (const EdgeMesh& mesh : input.objects)
    forest.motions.push_back(motion_of(mesh, input.lane_scale));
  for_every_tree(
      input, config.cull_concave, forest, [&](auto& wedges, ShapeId object, ForestGroup group) {
        set_speeds(input.object(object), input.lane_scale, forest.motions[object.index()], wedges);
        append_tree(wedges, object, group, threads, config, forest);
      });
  const auto moves = [&](NodeId root) {
    return bits((root < 0 ? forest.edges[~root].speed : forest.inner[root].speed) > 0) != 0;
  };
  std::ranges::copy_if(forest.roots, std::back_inserter(forest.moving_roots), moves);
  return forest;
}

}  // namespace limn
