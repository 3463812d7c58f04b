// The edge forest with leaves of up to 64 edges, which are described anew for every draw.
#include "tools/benchmark/leaf_forest.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <vector>

#include "edgetree/forest/forest_build.h"
#include "edgetree/forest/forest_choice.h"
#include "edgetree/forest/forest_query.h"
#include "edgetree/lobe/seen_edge.h"

namespace limn {
namespace {

struct Leaf {
  float center[3], inverse_radius;
  uint32_t parent;  // kWidth * inner node + lane, or kNoParent
  uint32_t first, count;
  ShapeId object;
  ForestGroup group;
};

class LeafForest final : public EdgeSampler {
 public:
  LeafForest(const EdgeSamplerInput& input, int threads, LeafSize size, const ForestConfig& config)
      : input_(input), config_(config), wide_(size == LeafSize::k64) {
    const Forest whole = build_forest(input, threads, config);
    forest_ = whole;
    forest_.inner.clear();
    forest_.roots.clear();
    forest_.edges = {};
    forest_.slots = {};
    for (const auto& slots : whole.slots) leaf_of_.emplace_back(slots.size(), kNoParent);
    for (const NodeId root : whole.roots) forest_.roots.push_back(add(whole, root, kNoParent));
    forest_.inner.shrink_to_fit();
    leaves_.shrink_to_fit();
    edges_.shrink_to_fit();
  }

  std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const override {
    double u = rng.uniform();
    const double u_t = rng.uniform();
    const ForestQuery prepared = prepare(query);
    Choice choice;
    double scale = 0, probability = 1;
    const auto at = [&](NodeId id) { return choice_at(prepared, id); };
    if (!choose_root(forest_.roots, at, u, choice, scale)) return std::nullopt;
    while (scale > 0) {
      const int lane = choice.draw(u);
      probability *= choice.weights[lane] / scale;
      if (choice.node < 0) return finish(prepared, choice.node, lane, u, u_t, probability);
      choice = choice_at(prepared, forest_.inner[choice.node].child[lane]);
      scale = choice.total;
    }
    return std::nullopt;
  }

  double probability(const EdgeQuery& query, EdgeRef id) const override {
    const uint32_t index = leaf_of_[id.object.index()][id.edge.index()];
    if (index == kNoParent) return 0;
    const ForestQuery prepared = prepare(query);
    const Leaf& leaf = leaves_[index];
    const auto edges = edges_.begin() + leaf.first;
    const auto place = static_cast<uint32_t>(
        std::find(edges, edges + leaf.count, static_cast<uint32_t>(id.edge.index())) - edges);
    const EdgeNode node = chunk(leaf, place / kWidth);
    const int lane = static_cast<int>(place % kWidth);
    if (!accepts(prepared, node, lane) || !seen(prepared, node, lane).is_seen()) return 0;
    const NodeId leaf_id = ~static_cast<NodeId>(index);
    if (leaf.count <= kWidth) return reach(prepared, leaf_id, leaf.parent, lane);
    const Choice inside(leaf_id, weigh_edges(node, prepared));
    if (!(inside.total > 0)) return 0;
    return reach(prepared, leaf_id, leaf.parent, static_cast<int>(place / kWidth)) *
           (inside.weights[lane] / inside.total);
  }

  double pdf_t(const EdgeQuery& query, EdgeRef id, double t) const override {
    const EdgeMesh& mesh = input_.object(id.object);
    const auto [a, b] = mesh.edge(id.edge).vertices;
    const SeenEdge edge(LtcLobe(query.lobe, query.n, query.wi), mesh.position(a) - query.p,
                        mesh.position(b) - query.p);
    return edge.is_seen() ? edge.pdf_t(t) : 0;
  }

  // The forest's: as many draws to measure.
  double draw_cost() const override { return 3; }
  double query_cost() const override { return 4; }
  SamplerSize size() const override {
    uint64_t bytes = forest_.inner.size() * sizeof(InnerNode) + leaves_.size() * sizeof(Leaf) +
                     edges_.size() * sizeof(uint32_t) + forest_.roots.size() * sizeof(NodeId);
    for (const auto& leaves : leaf_of_) bytes += leaves.size() * sizeof(uint32_t);
    return {forest_.inner.size() + leaves_.size(), bytes};
  }

 private:
  // Copies what is below a node of the whole forest, and returns its place here.
  NodeId add(const Forest& whole, NodeId id, uint32_t parent) {
    const NodeHead& head = whole.head(id);
    if (head.height > (wide_ ? 1 : 0)) {
      const auto place = static_cast<NodeId>(forest_.inner.size());
      forest_.inner.push_back(whole.inner[id]);
      forest_.inner.back().head.parent = parent;
      // Leaves are looked ahead at here: there is nothing of theirs to fetch.
      for (int lane = 0; lane < kWidth; ++lane) {
        const NodeId child = whole.inner[id].child[lane];
        if (child == kNoChild) continue;
        const NodeId added = add(whole, child, kWidth * static_cast<uint32_t>(place) + lane);
        InnerNode& node = forest_.inner[place];
        node.child[lane] = added;
        if (added < 0) node.ahead &= static_cast<uint8_t>(~(1U << lane));
      }
      return place;
    }
    const auto index = static_cast<uint32_t>(leaves_.size());
    Leaf leaf{{head.center[0], head.center[1], head.center[2]},
              head.inverse_radius,
              parent,
              static_cast<uint32_t>(edges_.size()),
              0,
              head.object,
              head.group};
    add_edges(whole, id, index);
    leaf.count = static_cast<uint32_t>(edges_.size()) - leaf.first;
    leaves_.push_back(leaf);
    return ~static_cast<NodeId>(index);
  }

  void add_edges(const Forest& whole, NodeId id, uint32_t leaf) {
    for (int lane = 0; lane < kWidth; ++lane) {
      const int32_t child = id < 0 ? whole.edges[~id].edge[lane] : whole.inner[id].child[lane];
      if (child == kNoChild) continue;
      if (id >= 0) {
        add_edges(whole, child, leaf);
        continue;
      }
      edges_.push_back(static_cast<uint32_t>(child));
      leaf_of_[whole.head(id).object.index()][child] = leaf;
    }
  }

  ForestQuery prepare(const EdgeQuery& query) const {
    return {forest_, nullptr, nullptr, query, input_};
  }

  // Eight edges of a leaf, as the forest has them in a node.
  EdgeNode chunk(const Leaf& leaf, uint32_t number) const {
    EdgeNode node{};
    std::copy(std::begin(leaf.center), std::end(leaf.center), node.head.center);
    node.head.inverse_radius = leaf.inverse_radius;
    node.head.object = leaf.object;
    node.head.group = leaf.group;
    node.edge = Ints{} + kNoChild;
    const NodeFrame frame{{leaf.center[0], leaf.center[1], leaf.center[2]}, leaf.inverse_radius};
    const EdgeMesh& mesh = input_.object(leaf.object);
    const uint32_t begin = kWidth * number, end = std::min(leaf.count, begin + kWidth);
    for (uint32_t i = begin; i < end; ++i)
      put_edge(mesh, EdgeId(edges_[leaf.first + i]), frame, static_cast<int>(i - begin), node);
    return node;
  }
  // As the build does, but for speeds, which are zero.
  static void put_edge(const EdgeMesh& mesh, EdgeId id, const NodeFrame& frame, int lane,
                       EdgeNode& node) {
    const Edge& edge = mesh.edge(id);
    Wedge wedge;
    wedge.planes[0] = mesh.plane(edge.faces[0]);
    wedge.planes[1] = edge.faces[1].valid() ? mesh.plane(edge.faces[1]) : wedge.planes[0];
    for (int e = 0; e < 2; ++e) wedge.ends[e] = mesh.position(edge.vertices[e]);
    const DualFit fit = fit_edge(wedge, frame);
    for (int i = 0; i < 2; ++i)
      for (int k = 0; k < 4; ++k) node.rows[i][k][lane] = static_cast<float>(fit.rows[i][k]);
    const double size = length(wedge.ends[1] - wedge.ends[0]) * frame.inverse_radius;
    node.length[lane] = static_cast<float>(
        std::max(size * frame.inverse_radius, double{std::numeric_limits<float>::min()}));
    node.edge[lane] = static_cast<int32_t>(id.index());
    for (int e = 0; e < 2; ++e)
      for (int k = 0; k < 3; ++k) node.ends[e][k][lane] = static_cast<float>(wedge.ends[e][k]);
  }
  static uint32_t chunks(const Leaf& leaf) { return (leaf.count + kWidth - 1) / kWidth; }

  // Of the edges of a leaf, or of its chunks where it has many.
  Choice choice_at_leaf(const ForestQuery& query, NodeId id) const {
    const Leaf& leaf = leaves_[~id];
    if (leaf.count <= kWidth) return {id, weigh_edges(chunk(leaf, 0), query)};
    Floats weights{};
    for (uint32_t i = 0; i < chunks(leaf); ++i)
      weights[i] = sum(weigh_edges(chunk(leaf, i), query));
    return {id, weights};
  }

  Choice choice_at(const ForestQuery& query, NodeId id) const {
    if (id < 0) return choice_at_leaf(query, id);
    const InnerNode& node = forest_.inner[id];
    ChildWeights children = weigh_children(node, query, config_.soft_weights);
    const float unit = node.head.inverse_radius;
    for (uint32_t lanes = bits(children.rest > 0); lanes != 0; lanes &= lanes - 1) {
      const int lane = std::countr_zero(lanes);
      const NodeId child = node.child[lane];
      if (child >= 0 && (node.ahead >> lane & 1) != 0) {
        children.length[lane] =
            length_below(forest_.inner[child], query.point, config_.soft_weights, unit);
      } else if (child < 0 && !wide_ && config_.look_ahead >= 0) {
        children.length[lane] = length_below(chunk(leaves_[~child], 0), query.point, unit);
      }
    }
    return {id, children.product()};
  }

  // A leaf is reached: what is left is a lane of the chunk, and a point. place: an edge's lane, or
  // a chunk's number.
  std::optional<EdgeSample> finish(const ForestQuery& query, NodeId id, int place, double u,
                                   double u_t, double probability) const {
    const Leaf& leaf = leaves_[~id];
    const bool many = leaf.count > kWidth;
    const EdgeNode node = chunk(leaf, many ? static_cast<uint32_t>(place) : 0);
    int lane = place;
    if (many) {
      const Choice inside(id, weigh_edges(node, query));
      lane = inside.draw(u);
      probability *= inside.weights[lane] / inside.total;
    }
    if (!accepts(query, node, lane)) return std::nullopt;
    const SeenEdge edge = seen(query, node, lane);
    if (!edge.is_seen()) return std::nullopt;
    EdgeSample sample{node.edge_at(lane), edge.sample_t(u_t), probability, 0};
    sample.pdf_t = edge.pdf_t(sample.t);
    if (!(sample.pdf_t > 0)) return std::nullopt;
    return sample;
  }

  // Probability of drawing what is in a lane of a node; parent: where the node hangs.
  double reach(const ForestQuery& query, NodeId id, uint32_t parent, int lane) const {
    const Choice choice = choice_at(query, id);
    double before = 1, scale = choice.total;
    if (parent == kNoParent) {
      scale = 0;
      for (const NodeId root : forest_.roots) scale += choice_at(query, root).total;
    } else {
      const auto above = static_cast<NodeId>(parent / kWidth);
      before =
          reach(query, above, forest_.inner[above].head.parent, static_cast<int>(parent % kWidth));
    }
    return before > 0 && scale > 0 ? before * (choice.weights[lane] / scale) : 0;
  }

  bool accepts(const ForestQuery& query, const EdgeNode& node, int lane) const {
    if (config_.cull_concave && surely_candidate(node, lane, query.point)) return true;
    const EdgeRef id = node.edge_at(lane);
    return is_candidate(input_.object(id.object), id.edge, query.point.p);
  }
  static SeenEdge seen(const ForestQuery& query, const EdgeNode& node, int lane) {
    const auto end = [&](int e) {
      return Vec3d{node.ends[e][0][lane], node.ends[e][1][lane], node.ends[e][2][lane]} -
             query.point.p;
    };
    return {query.lobe, end(0), end(1)};
  }

  const EdgeSamplerInput& input_;
  ForestConfig config_;
  bool wide_;
  Forest forest_;  // without nodes of edges and slots; ids below zero are of leaves
  std::vector<Leaf> leaves_;
  std::vector<uint32_t> edges_;                 // of all leaves, in their order
  std::vector<std::vector<uint32_t>> leaf_of_;  // [object][edge], or kNoParent
};

}  // namespace

std::unique_ptr<EdgeSampler> make_leaf_forest(const EdgeSamplerInput& input, int threads,
                                              LeafSize size, const ForestConfig& config) {
  return std::make_unique<LeafForest>(input, threads, size, config);
}

}  // namespace limn
