#include "forest_build.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>

#include "forest_fit.h"
#include "forest_split.h"
#include "limn/core/parallel.h"

namespace limn {
namespace {

// Nothing for an edge that no query needs.
std::optional<ForestGroup> group_of(const EdgeMesh& mesh, const Edge& edge,
                                    const ForestConfig& config) {
  switch (edge.edge_class) {
    case EdgeClass::kSmooth:
    case EdgeClass::kFlat:
      if (config.cull_concave && edge.concave && mesh.one_sided_closed) return std::nullopt;
      return ForestGroup::kSilhouette;
    case EdgeClass::kSharp:
      return mesh.one_sided_closed ? ForestGroup::kFront : ForestGroup::kAlways;
    default:
      return ForestGroup::kAlways;
  }
}

double speed_of(const EdgeMesh& mesh, uint32_t vertex, const Lanes& scale) {
  if (mesh.tangents.empty()) return 0;
  const Vec3<Lanes>& v = mesh.tangents[vertex];
  double sum = 0;
  for (int i = 0; i < kLanes; ++i) sum += scale[i] * std::hypot(v.x[i], v.y[i], v.z[i]);
  return sum;
}

Wedge wedge_of(const EdgeMesh& mesh, uint32_t index, const Lanes& scale) {
  const Edge& edge = mesh.edges[index];
  const auto [a, b] = edge.vertices;
  Wedge wedge;
  wedge.planes[0] = mesh.planes[edge.faces[0]];
  wedge.planes[1] = edge.faces[1] == kNoFace ? wedge.planes[0] : mesh.planes[edge.faces[1]];
  wedge.ends = {mesh.positions[a], mesh.positions[b]};
  wedge.length = length(wedge.ends[1] - wedge.ends[0]);
  const Vec3d &n0 = wedge.planes[0].n, &n1 = wedge.planes[1].n;
  wedge.angle = std::atan2(length(cross(n0, n1)), dot(n0, n1));
  wedge.speed = 0.5 * (speed_of(mesh, a, scale) + speed_of(mesh, b, scale));
  wedge.edge = index;
  return wedge;
}

struct Box {
  Vec3d low{1e300, 1e300, 1e300}, high{-1e300, -1e300, -1e300};
  Vec3d center() const { return (low + high) * 0.5; }
  Vec3d half() const { return (high - low) * 0.5; }
};
Box box_of(std::span<const Wedge> wedges) {
  Box box;
  for (const Wedge& wedge : wedges)
    for (const Vec3d& x : wedge.ends)
      for (int k = 0; k < 3; ++k) {
        box.low[k] = std::min(box.low[k], x[k]);
        box.high[k] = std::max(box.high[k], x[k]);
      }
  return box;
}

// The 24 leading bits: a number that a float holds. Not by a cast to float and back, because GCC 12
// drops such a pair of casts where it makes vectors of them.
double truncated(double x) {
  return std::bit_cast<double>(std::bit_cast<uint64_t>(x) & ~((uint64_t{1} << 29) - 1));
}

NodeFrame frame_of(const Box& box) {
  const Vec3d center = box.center();
  return {{truncated(center.x), truncated(center.y), truncated(center.z)},
          truncated(length(box.half()))};
}

float rounded_up(double x) {
  const auto f = static_cast<float>(x);
  return f >= x ? f : std::nextafter(f, std::numeric_limits<float>::max());
}

// Fills the nodes of one tree, each on its own.
class TreeFiller {
 public:
  TreeFiller(const SplitTree& tree, std::span<const Wedge> wedges, ForestGroup group,
             const ForestConfig& config)
      : tree_(tree), wedges_(wedges), group_(group), config_(config) {}

  // All but parent and object; offset: of the tree's nodes in the forest.
  ForestNode fill(uint32_t index, uint32_t offset) const {
    const SplitNode& split = tree_.nodes[index];
    ForestNode node{};
    const NodeFrame frame = frame_of(box_of(edges(split.range)));
    for (int k = 0; k < 3; ++k) node.center[k] = static_cast<float>(frame.center[k]);
    node.radius = static_cast<float>(frame.radius);
    node.group = group_;
    for (int lane = 0; lane < kWidth; ++lane) {
      const EdgeRange range = split.ranges[lane];
      if (range.size() == 0) continue;
      const uint32_t child = split.children[lane];
      node.child[lane] = child != 0 ? static_cast<int32_t>(child + offset)
                                    : ~static_cast<int32_t>(wedges_[range.begin].edge);
      if (child != 0 && has_edges_only(tree_.nodes[child])) node.twigs |= 1 << lane;
      fill_lane(edges(range), frame, lane, node);
    }
    return node;
  }

 private:
  std::span<const Wedge> edges(EdgeRange range) const {
    return wedges_.subspan(range.begin, range.size());
  }

  static bool has_edges_only(const SplitNode& node) {
    return std::all_of(node.children.begin(), node.children.end(),
                       [](uint32_t child) { return child == 0; });
  }

  DualFit fit(std::span<const Wedge> wedges, const NodeFrame& frame) const {
    if (group_ == ForestGroup::kSilhouette) return fit_dual(wedges, frame, config_);
    double length = 0;
    for (const Wedge& wedge : wedges) length += wedge.length;
    if (group_ == ForestGroup::kAlways) return unrejectable_fit(length);
    DualFit fit = fit_dual(wedges, frame, config_);
    fit.cover[0] = length;
    return fit;
  }

  void fill_lane(std::span<const Wedge> wedges, const NodeFrame& frame, int lane,
                 ForestNode& node) const {
    const DualFit dual = fit(wedges, frame);
    const auto put = [lane](Float4& lanes, double value) {
      lanes[lane] = static_cast<float>(value);
    };
    for (int i = 0; i < 4; ++i)
      for (int k = 0; k < 4; ++k) put(node.rows[i][k], dual.rows[i][k]);
    const double squared = frame.radius * frame.radius;
    for (int k = 0; k < 3; ++k) put(node.cover[k], dual.cover[k] / squared);
    const Box box = box_of(wedges);
    for (int k = 0; k < 3; ++k) {
      const double center = truncated((box.center()[k] - frame.center[k]) / frame.radius);
      put(node.box_center[k], center);
      const double low = (box.low[k] - frame.center[k]) / frame.radius;
      const double high = (box.high[k] - frame.center[k]) / frame.radius;
      node.box_half[k][lane] = rounded_up(std::max(high - center, center - low));
    }
    double length = 0, speed = 0;
    for (const Wedge& wedge : wedges) {
      length += wedge.length;
      speed += wedge.length * wedge.speed;
    }
    // Motion too slow for a float still is motion.
    put(node.speed,
        speed > 0 ? std::max(speed / length, double{std::numeric_limits<float>::min()}) : 0);
  }

  const SplitTree& tree_;
  std::span<const Wedge> wedges_;
  ForestGroup group_;
  const ForestConfig& config_;
};

void append_tree(std::span<const Wedge> wedges, uint32_t object, ForestGroup group, int threads,
                 const ForestConfig& config, Forest& forest) {
  const SplitTree tree = split_edges(wedges, threads);
  std::vector<Wedge> sorted(wedges.size());
  parallel_for((wedges.size() + 4095) / 4096, threads, [&](size_t block) {
    for (size_t i = 4096 * block; i < std::min(wedges.size(), 4096 * (block + 1)); ++i)
      sorted[i] = wedges[tree.order[i]];
  });
  const auto offset = static_cast<uint32_t>(forest.nodes.size());
  forest.roots.push_back(offset);
  forest.nodes.resize(offset + tree.nodes.size());
  const TreeFiller filler(tree, sorted, group, config);
  constexpr size_t kBlock = 64;
  parallel_for((tree.nodes.size() + kBlock - 1) / kBlock, threads, [&](size_t block) {
    const size_t end = std::min(tree.nodes.size(), kBlock * (block + 1));
    for (size_t i = kBlock * block; i < end; ++i) {
      ForestNode& node = forest.nodes[offset + i];
      node = filler.fill(static_cast<uint32_t>(i), offset);
      node.object = object;
    }
  });
  forest.nodes[offset].parent = kNoParent;
  for (uint32_t i = offset; i < forest.nodes.size(); ++i)
    for (uint32_t lane = 0; lane < kWidth; ++lane) {
      const int32_t child = forest.nodes[i].child[lane];
      if (child > 0) forest.nodes[child].parent = kWidth * i + lane;
      if (child < 0) forest.slots[object][~child] = kWidth * i + lane;
    }
}

}  // namespace

Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config) {
  Forest forest;
  for (uint32_t object = 0; object < input.objects.size(); ++object) {
    const EdgeMesh& mesh = input.objects[object];
    forest.extent = std::max(forest.extent, mesh.extent);
    forest.slots.emplace_back(mesh.edges.size(), kNoParent);
    std::vector<Wedge> groups[kForestGroups];
    for (uint32_t e = 0; e < mesh.edges.size(); ++e)
      if (const auto group = group_of(mesh, mesh.edges[e], config))
        groups[static_cast<int>(*group)].push_back(wedge_of(mesh, e, input.lane_scale));
    for (int g = 0; g < kForestGroups; ++g)
      if (!groups[g].empty())
        append_tree(groups[g], object, static_cast<ForestGroup>(g), threads, config, forest);
  }
  return forest;
}

}  // namespace limn
