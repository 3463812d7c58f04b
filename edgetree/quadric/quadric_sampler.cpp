// The paper's forest as a sampler: descents.
#include "edgetree/quadric/quadric_sampler.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "edgetree/forest/choose_root.h"
#include "edgetree/lobe/seen_edge.h"
#include "edgetree/quadric/quadric_node.h"
#include "edgetree/quadric/quadric_query.h"
#include "limn/edgetree/quadric_chart.h"

namespace limn {
namespace {

// A node and the weights of its children.
struct Choice {
  NodeId node = kNoChild;
  double weights[kQuadricWidth];
  double total = 0;

  void sum() {
    total = 0;
    for (const double weight : weights) total += weight;
  }
  // Draws a child by the uniform number u, which is rescaled to be uniform again; total > 0.
  int draw(double& u) const {
    double rest = u * total;
    int lane = 0;
    while (lane + 1 < kQuadricWidth && rest >= weights[lane]) rest -= weights[lane++];
    while (!(weights[lane] > 0)) lane = (lane + kQuadricWidth - 1) % kQuadricWidth;  // rounding
    u = below_one(rest / weights[lane]);
    return lane;
  }
};

// Its nodes are the children of the forest's nodes, and the edges of leaves.
class QuadricRejectionTree final : public ChartedTree {
 public:
  QuadricRejectionTree(const EdgeSamplerInput& input, const QuadricForest& forest)
      : input_(input), forest_(forest) {
    for (const NodeId root : forest.roots) append(root, kNoNode, 1);
  }

  bool rejects(uint32_t node, const Vec3d& p) const override {
    const auto [id, lane] = slots_[node];
    if (id < 0) {
      const EdgeRef edge = edges_[nodes_[node].begin];
      return !is_candidate(input_.object(edge.object), edge.edge, p);
    }
    return may_hold_candidates(forest_, id, QuadricPoint(forest_, p))[lane] == 0;
  }

  std::optional<QuadricChart> chart(uint32_t node) const override {
    const auto [id, lane] = slots_[node];
    if (id < 0 || forest_.pairs.empty()) return std::nullopt;
    const QuadricPairs& pair = forest_.pairs[id];
    QuadricChart chart{{}, {}, {}, pair.low[lane], pair.high[lane], {}};
    if (!std::isfinite(chart.low) || is_thin(id, lane)) return std::nullopt;
    for (int k = 0; k < 3; ++k) {
      chart.linear[k] = pair.linear[k][lane];
      chart.square[k] = pair.square[k][lane];
      chart.product[k] = pair.product[k][lane];
    }
    for (const EdgeRef id_of_edge : edges(node)) {
      const EdgeMesh& mesh = input_.object(id_of_edge.object);
      const auto& faces = mesh.edge(id_of_edge.edge).faces;
      if (!faces[1].valid()) continue;
      chart.edges.push_back(
          {in_chart(id, lane, mesh.plane(faces[0])), in_chart(id, lane, mesh.plane(faces[1]))});
    }
    return chart;
  }

 private:
  // True if the rounding of a child's rows to floats exceeds 2^-12 of its dual box's width.
  bool is_thin(NodeId id, int lane) const {
    for (int r = 1; r < 4; ++r) {
      double square = 0;
      for (const FourFloats& x : forest_.nodes[id].rows[r]) square += double(x[lane]) * x[lane];
      if (square < 0x1p-24) return true;
    }
    return false;
  }
  // The coordinates of a plane in a child's dual box.
  Vec3d in_chart(NodeId id, int lane, const Plane& plane) const {
    const QuadricNode& node = forest_.nodes[id];
    Eigen::Matrix4d rows;
    for (int r = 0; r < 4; ++r) {
      for (int c = 0; c < 4; ++c) rows(c, r) = node.rows[r][c][lane];
    }
    const double offset = plane.n.x * node.origin[0] + plane.n.y * node.origin[1] +
                          plane.n.z * node.origin[2] + plane.offset;
    const Eigen::Vector4d u = rows.fullPivLu().solve(
        Eigen::Vector4d(plane.n.x, plane.n.y, plane.n.z, offset * node.inverse_radius));
    return Vec3d{u[1], u[2], u[3]} / u[0];
  }

  struct Slot {
    NodeId node;
    int lane;
  };

  // Appends the children of a node and their descendants.
  void append(NodeId id, uint32_t parent, uint32_t depth) {
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      const int32_t child = forest_.lanes(id)[lane];
      if (child == kNoChild) continue;
      const auto node = static_cast<uint32_t>(nodes_.size());
      nodes_.push_back({parent, 0, depth, static_cast<uint32_t>(edges_.size()), 0});
      slots_.push_back({id, lane});
      if (id < 0) {
        edges_.push_back({forest_.leaves[~id].object, EdgeId(static_cast<uint32_t>(child))});
      } else {
        append(child, node, depth + 1);
      }
      nodes_[node].after = static_cast<uint32_t>(nodes_.size());
      nodes_[node].end = static_cast<uint32_t>(edges_.size());
    }
  }

  const EdgeSamplerInput& input_;
  const QuadricForest& forest_;
  std::vector<Slot> slots_;  // of each node
};

}  // namespace

struct QuadricSampler::Impl {
  const EdgeSamplerInput& input;
  QuadricConfig config;
  PolygonLights lights;
  QuadricForest forest;

  QuadricQuery prepare(const EdgeQuery& query) const {
    const bool lit = config.light_term && !lights.empty();
    return {forest, lit ? &lights : nullptr, query};
  }

  // Sampling and probabilities both use this function, so they agree bit for bit.
  Choice choice_at(NodeId id, const QuadricQuery& query) const {
    Choice choice;
    choice.node = id;
    if (id < 0) {
      weigh_edges(input, forest.leaves[~id], query, choice.weights);
    } else {
      weigh_children(forest, id, query, choice.weights);
    }
    choice.sum();
    return choice;
  }

  double root_total(const QuadricQuery& query) const {
    double total = 0;
    for (NodeId root : forest.roots) total += choice_at(root, query).total;
    return total;
  }

  struct Draw {
    EdgeRef edge;
    double probability = 1;
  };
  std::optional<Draw> draw(const QuadricQuery& query, double u) const {
    Choice choice;
    double scale;
    const auto at = [&](NodeId root) { return choice_at(root, query); };
    if (!choose_root(forest.roots, at, u, choice, scale)) return std::nullopt;
    Draw result;
    while (true) {
      const int lane = choice.draw(u);
      result.probability *= choice.weights[lane] / scale;
      const int32_t child = forest.lanes(choice.node)[lane];
      if (choice.node < 0) {
        result.edge = {forest.leaves[~choice.node].object, EdgeId(static_cast<uint32_t>(child))};
        return result;
      }
      choice = choice_at(child, query);
      scale = choice.total;
      if (!(scale > 0)) return std::nullopt;
    }
  }

  // Probability of drawing a child; multiplied from the root on, as in
  // `draw`.
  double probability(NodeId id, int lane, const QuadricQuery& query) const {
    const uint32_t parent = forest.parent(id);
    const bool is_root = parent == kNoParent;
    const double reach = is_root ? 1
                                 : probability(static_cast<NodeId>(parent / kQuadricWidth),
                                               static_cast<int>(parent % kQuadricWidth), query);
    if (reach == 0) return 0;
    const Choice choice = choice_at(id, query);
    const double scale = is_root ? root_total(query) : choice.total;
    return scale > 0 ? reach * (choice.weights[lane] / scale) : 0;
  }

  SeenEdge seen_edge(const LtcLobe& lobe, const Vec3d& p, EdgeRef id) const {
    const EdgeMesh& mesh = input.object(id.object);
    const auto [a, b] = mesh.edge(id.edge).vertices;
    return {lobe, mesh.position(a) - p, mesh.position(b) - p};
  }
};

QuadricSampler::QuadricSampler(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
QuadricSampler::~QuadricSampler() = default;

std::unique_ptr<QuadricSampler> QuadricSampler::build(const EdgeSamplerInput& input, int threads,
                                                      const QuadricConfig& config) {
  auto impl = std::unique_ptr<Impl>(
      new Impl{input, config, PolygonLights(input.lights, input.environment_luminance),
               build_quadric_forest(input, threads, config)});
  return std::unique_ptr<QuadricSampler>(new QuadricSampler(std::move(impl)));
}

std::optional<EdgeSample> QuadricSampler::sample(const EdgeQuery& query, Rng& rng) const {
  const double u_edge = rng.uniform(), u_t = rng.uniform();
  const QuadricQuery prepared = impl_->prepare(query);
  const auto draw = impl_->draw(prepared, u_edge);
  if (!draw) return std::nullopt;
  const SeenEdge edge = impl_->seen_edge(prepared.lobe, query.p, draw->edge);
  if (!edge.is_seen()) return std::nullopt;
  EdgeSample sample{draw->edge, edge.sample_t(u_t), draw->probability, 0};
  sample.pdf_t = edge.pdf_t(sample.t);
  // Rejected where the density underflows, on an edge in the horizon.
  if (!(sample.pdf_t > 0)) return std::nullopt;
  return sample;
}

double QuadricSampler::probability(const EdgeQuery& query, EdgeRef id) const {
  const uint32_t slot = impl_->forest.slots[id.object.index()][id.edge.index()];
  if (slot == kNoParent) return 0;
  const QuadricQuery prepared = impl_->prepare(query);
  if (!impl_->seen_edge(prepared.lobe, query.p, id).is_seen()) return 0;
  return impl_->probability(~static_cast<NodeId>(slot / kQuadricWidth),
                            static_cast<int>(slot % kQuadricWidth), prepared);
}

double QuadricSampler::pdf_t(const EdgeQuery& query, EdgeRef id, double t) const {
  const SeenEdge edge = impl_->seen_edge(LtcLobe(query.lobe, query.n, query.wi), query.p, id);
  return edge.is_seen() ? edge.pdf_t(t) : 0;
}

SamplerSize QuadricSampler::size() const {
  return {impl_->forest.nodes.size() + impl_->forest.leaves.size(), impl_->forest.bytes()};
}

std::unique_ptr<RejectionTree> QuadricSampler::rejection_tree() const {
  return std::make_unique<QuadricRejectionTree>(impl_->input, impl_->forest);
}

}  // namespace limn
