// The contour query of Nowrouzezahrai, Baran, Mitchell, Jarosz 2014 (section 3.1), for all of
// E(p). In the space of planes (n, offset) an edge is the segment between the planes of its
// faces, and the planes through p form the hyperplane (p, 1) . q = 0. The edge is a
// silhouette if the hyperplane cuts the segment, so a node is rejected if the hyperplane
// misses its box:
// |c . x| > sum of h_i |x_i|, with x = (p, 1), the box's center c and half-widths h.
// Differences: space is scaled so that the mesh fills the unit ball, or the fourth axis would
// dominate all splits. Sharp edges of closed one-sided meshes, which need p in front of a
// face, have a separate tree whose boxes are rejected from behind; edges that are always in
// E(p) are in a list. Splits are at the median of the widest axis of segment midpoints. Draws
// are those of `brute`, which finds the same edges.
#include <algorithm>
#include <array>
#include <cmath>

#include "edgetree/baselines/baselines.h"
#include "edgetree/baselines/listing_sampler.h"
#include "limn/core/bounds.h"

namespace limn {
namespace {

using Dual = std::array<double, 4>;

// The condition under which an edge is in E(p).
enum class Kind : uint8_t {
  kNever,
  kSilhouette,  // p is between its planes
  kFacing,      // p is in front of one of its faces
  kAlways
};
Kind kind_of(const EdgeMesh& mesh, const Edge& edge) {
  switch (edge.edge_class) {
    case EdgeClass::kSmooth:
      return edge.concave && mesh.one_sided_closed ? Kind::kNever : Kind::kSilhouette;
    case EdgeClass::kFlat:
      return Kind::kSilhouette;
    case EdgeClass::kSharp:
    case EdgeClass::kTexture:
      return mesh.one_sided_closed ? Kind::kFacing : Kind::kAlways;
    default:
      return Kind::kAlways;
  }
}

struct Node {
  std::array<float, 4> center, half;  // contains its segments after rounding
  uint32_t begin = 0, end = 0;        // of the edges
  uint32_t right = 0;                 // second child; the first follows its parent; 0 for a leaf
  Kind kind = Kind::kAlways;
};

// A point as a hyperplane in the frame of a tree.
struct DualPoint {
  Dual x;
  double error;  // of a distance
};

// The trees over one mesh.
class DualTree {
 public:
  explicit DualTree(const EdgeMesh& mesh) : mesh_(mesh) {
    Bounds bounds;
    for (const Edge& edge : mesh.edges)
      for (const VertexId vertex : edge.vertices) bounds.extend(mesh.position(vertex));
    if (mesh.edges.empty()) return;
    center_ = bounds.center();
    radius_ = std::max(0.5 * bounds.diagonal(), 1e-300);
    for (const Kind kind : {Kind::kSilhouette, Kind::kFacing, Kind::kAlways}) add_tree(kind);
  }

  DualPoint at(const Vec3d& p) const {
    const Vec3d w = (p - center_) / radius_;
    // The frame's rounding error equals that of the distance.
    return {{w.x, w.y, w.z, 1}, 2 * distance_error(mesh_, p) / radius_};
  }

  bool rejects(const Node& node, const DualPoint& point) const {
    if (node.kind == Kind::kAlways) return false;
    double middle = 0, reach = 0, size = 0;
    for (int i = 0; i < 4; ++i) {
      middle += node.center[i] * point.x[i];
      reach += node.half[i] * std::fabs(point.x[i]);
      size += std::fabs(node.center[i] * point.x[i]);
    }
    reach += point.error + 0x1p-49 * (size + reach);
    return node.kind == Kind::kFacing ? middle < -reach : std::fabs(middle) > reach;
  }

  void find(const Vec3d& p, std::vector<uint32_t>& found) const {
    const DualPoint point = at(p);
    for (uint32_t i = 0; i < nodes_.size();) {
      const Node& node = nodes_[i];
      const bool leaf = node.right == 0;
      if (rejects(node, point)) {
        i += 2 * (node.end - node.begin) - 1;  // nodes of a binary tree
        continue;
      }
      if (leaf && is_candidate(mesh_, EdgeId(edges_[node.begin]), p))
        found.push_back(edges_[node.begin]);
      ++i;
    }
  }

  const std::vector<Node>& nodes() const { return nodes_; }
  const std::vector<uint32_t>& edges() const { return edges_; }

 private:
  void add_tree(Kind kind) {
    const auto begin = static_cast<uint32_t>(edges_.size());
    std::vector<Dual> middles(mesh_.edges.size());
    for (uint32_t e = 0; e < mesh_.edges.size(); ++e) {
      if (kind_of(mesh_, mesh_.edges[e]) != kind) continue;
      edges_.push_back(e);
      if (kind != Kind::kAlways) middles[e] = box_of(e).middle();
    }
    const auto end = static_cast<uint32_t>(edges_.size());
    if (end > begin) build(begin, end, kind, middles);
  }

  struct Box {
    Dual lower, upper;
    void extend(const Box& b) {
      for (int i = 0; i < 4; ++i) {
        lower[i] = std::min(lower[i], b.lower[i]);
        upper[i] = std::max(upper[i], b.upper[i]);
      }
    }
    Dual middle() const {
      Dual m;
      for (int i = 0; i < 4; ++i) m[i] = 0.5 * (lower[i] + upper[i]);
      return m;
    }
  };
  Box box_of(uint32_t e) const {
    const auto [a, b] = mesh_.edges[e].faces;
    const Dual first = dual_of(mesh_.plane(a)),
               second = b.valid() ? dual_of(mesh_.plane(b)) : first;
    Box box{first, first};
    box.extend({second, second});
    return box;
  }
  Dual dual_of(const Plane& plane) const {
    return {plane.n.x, plane.n.y, plane.n.z, plane.distance(center_) / radius_};
  }

  // Builds in depth-first order, with one edge per leaf. Returns the box.
  Box build(uint32_t begin, uint32_t end, Kind kind, const std::vector<Dual>& middles) {
    const auto index = static_cast<uint32_t>(nodes_.size());
    nodes_.push_back({{}, {}, begin, end, 0, kind});
    Box box{};
    if (end - begin == 1) {
      if (kind != Kind::kAlways) box = box_of(edges_[begin]);
    } else {
      const uint32_t middle = begin + (end - begin) / 2;
      split_at(begin, middle, end, middles);
      box = build(begin, middle, kind, middles);
      nodes_[index].right = static_cast<uint32_t>(nodes_.size());
      box.extend(build(middle, end, kind, middles));
    }
    fill(nodes_[index], box);
    return box;
  }

  void split_at(uint32_t begin, uint32_t middle, uint32_t end, const std::vector<Dual>& middles) {
    Box bounds{middles[edges_[begin]], middles[edges_[begin]]};
    for (uint32_t i = begin; i < end; ++i) {
      bounds.extend({middles[edges_[i]], middles[edges_[i]]});
    }
    int widest = 0;
    for (int i = 1; i < 4; ++i) {
      if (bounds.upper[i] - bounds.lower[i] > bounds.upper[widest] - bounds.lower[widest])
        widest = i;
    }
    std::nth_element(edges_.begin() + begin, edges_.begin() + middle, edges_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       const double x = middles[a][widest], y = middles[b][widest];
                       return x != y ? x < y : a < b;
                     });
  }

  static void fill(Node& node, const Box& box) {
    const Dual middle = box.middle();
    for (int i = 0; i < 4; ++i) {
      node.center[i] = static_cast<float>(middle[i]);
      const double half =
          std::max(box.upper[i] - node.center[i], double(node.center[i]) - box.lower[i]);
      node.half[i] = std::nextafter(static_cast<float>(half), INFINITY);
    }
  }

  const EdgeMesh& mesh_;
  Vec3d center_{};
  double radius_ = 1;
  std::vector<Node> nodes_;      // tree after tree, depth first
  std::vector<uint32_t> edges_;  // in the leaves' order
};

class DualRejectionTree final : public RejectionTree {
 public:
  explicit DualRejectionTree(const std::vector<DualTree>& trees) : trees_(trees) {
    for (uint32_t t = 0; t < trees.size(); ++t) {
      const auto first_edge = static_cast<uint32_t>(edges_.size());
      for (const uint32_t edge : trees[t].edges()) edges_.push_back({ShapeId(t), EdgeId(edge)});
      for (uint32_t i = 0; i < trees[t].nodes().size(); ++i) add(t, i, first_edge);
    }
  }

  bool rejects(uint32_t node, const Vec3d& p) const override {
    const auto [t, i] = tree_nodes_[node];
    return trees_[t].rejects(trees_[t].nodes()[i], trees_[t].at(p));
  }

 private:
  struct NodeIndex {
    uint32_t tree, node;
  };

  void add(uint32_t t, uint32_t i, uint32_t first_edge) {
    const Node& node = trees_[t].nodes()[i];
    const auto index = static_cast<uint32_t>(nodes_.size());
    while (!open_.empty() && nodes_[open_.back()].after <= index) open_.pop_back();
    const uint32_t parent = open_.empty() ? kNoNode : open_.back();
    open_.push_back(index);
    nodes_.push_back({parent, index + 2 * (node.end - node.begin) - 1,
                      static_cast<uint32_t>(open_.size()), first_edge + node.begin,
                      first_edge + node.end});
    tree_nodes_.push_back({t, i});
  }

  const std::vector<DualTree>& trees_;
  std::vector<NodeIndex> tree_nodes_;  // of each node
  std::vector<uint32_t> open_;         // ancestors of the next node, outermost first
};

class DualBvhSampler final : public ListingSampler {
 public:
  explicit DualBvhSampler(const EdgeSamplerInput& input) : ListingSampler(input) {
    for (const EdgeMesh& mesh : input.objects) trees_.emplace_back(mesh);
  }

  SamplerSize size() const override {
    SamplerSize size;
    for (const DualTree& tree : trees_) {
      size.nodes += tree.nodes().size();
      size.bytes += tree.nodes().size() * sizeof(Node) + tree.edges().size() * sizeof(uint32_t);
    }
    return size;
  }
  std::unique_ptr<RejectionTree> rejection_tree() const override {
    return std::make_unique<DualRejectionTree>(trees_);
  }

 private:
  void find_candidates(ShapeId object, const Vec3d& p,
                       std::vector<uint32_t>& found) const override {
    trees_[object.index()].find(p, found);
  }

  std::vector<DualTree> trees_;  // of each object
};

}  // namespace

std::unique_ptr<EdgeSampler> make_dual_bvh_sampler(const EdgeSamplerInput& input, int) {
  return std::make_unique<DualBvhSampler>(input);
}

}  // namespace limn
