#include "limn/edgetree/edge_forest.h"

#include <algorithm>

#include "forest_build.h"
#include "forest_query.h"
#include "samplers.h"
#include "seen_edge.h"

namespace limn {
namespace {

using Lookahead = ForestConfig::Lookahead;

// The weights of a node's children, and of theirs where those were looked at.
struct Weights {
  Float4 own;
  Float4 ahead[kWidth];
  double total() const {
    return (static_cast<double>(own[0]) + own[1]) + (static_cast<double>(own[2]) + own[3]);
  }
};

double below_one(double u) { return std::clamp(u, 0.0, 0x1.fffffffffffffp-1); }

// Draws a lane by the uniform number u and leaves another one in it. Some weight is positive.
int choose(const Weights& weights, double& u) {
  double rest = u * weights.total();
  int chosen = -1;
  for (int lane = 0; lane < kWidth; ++lane) {
    if (!(weights.own[lane] > 0)) continue;
    if (chosen >= 0) rest -= weights.own[chosen];
    chosen = lane;
    if (rest < weights.own[lane]) break;
  }
  u = below_one(rest / weights.own[chosen]);
  return chosen;
}

}  // namespace

struct EdgeForest::Impl {
  const EdgeSamplerInput& input;
  ForestConfig config;
  LightClusters lights;
  Forest forest;

  ForestQuery prepare(const EdgeQuery& query) const {
    const bool lit = config.light_term && !lights.empty();
    const RadiancePyramid* environment =
        config.environment_term ? input.environment.get() : nullptr;
    return {forest, lit ? &lights : nullptr, environment, query, input.lane_scale};
  }

  // Both sampling and evaluating a probability ask here, and get the same bits.
  void weigh(uint32_t index, const ForestQuery& query, Weights& weights) const {
    const ForestNode& node = forest.nodes[index];
    prefetch_children(node);
    weights.own = weigh_children(node, query, config.soft_weights);
    if (config.lookahead == Lookahead::kNone) return;
    for (int lane = 0; lane < kWidth; ++lane) {
      if (!(weights.own[lane] > 0) || node.child[lane] <= 0) continue;
      if (config.lookahead == Lookahead::kEdges && !is_twig(node, lane)) continue;
      const ForestNode& child = forest.nodes[node.child[lane]];
      weights.ahead[lane] = weigh_children(child, query, config.soft_weights);
      weights.own[lane] = sum(weights.ahead[lane]);
    }
  }

  // One of them is next: fetching starts while this node is weighed.
  void prefetch_children(const ForestNode& node) const {
    for (int lane = 0; lane < kWidth; ++lane) {
      if (node.child[lane] <= 0) continue;
      const auto* bytes = reinterpret_cast<const char*>(&forest.nodes[node.child[lane]]);
      for (size_t line = 0; line < sizeof(ForestNode); line += 64) __builtin_prefetch(bytes + line);
    }
  }

  // From `weights` of a node to those of a child.
  void descend(const ForestNode& node, int lane, const ForestQuery& query, Weights& weights) const {
    if (config.lookahead != Lookahead::kNone && is_twig(node, lane)) {
      weights.own = weights.ahead[lane];
    } else {
      weigh(static_cast<uint32_t>(node.child[lane]), query, weights);
    }
  }

  static bool is_twig(const ForestNode& node, int lane) { return (node.twigs >> lane & 1) != 0; }

  double root_total(const ForestQuery& query) const {
    double total = 0;
    Weights weights;
    for (uint32_t root : forest.roots) {
      weigh(root, query, weights);
      total += weights.total();
    }
    return total;
  }

  // Draws a root by the uniform number u, leaves another one in it, and the root's weights. Returns
  // kNoParent if no root has weight. total: root_total.
  uint32_t choose_root(const ForestQuery& query, double& u, Weights& weights, double& total) const {
    uint32_t chosen = kNoParent;
    Weights next;
    total = 0;
    for (uint32_t root : forest.roots) {
      weigh(root, query, chosen == kNoParent ? weights : next);
      const double weight = (chosen == kNoParent ? weights : next).total();
      total += weight;
      const double share = weight > 0 ? weight / total : 0;
      if (u < share) {
        u = below_one(u / share);
        if (chosen != kNoParent) weights = next;
        chosen = root;
      } else if (chosen != kNoParent) {
        u = below_one((u - share) / (1 - share));
      }
    }
    return chosen;
  }

  // Draws an edge without testing it.
  bool draw(const ForestQuery& query, double u, EdgeSample& sample) const {
    double scale;
    Weights weights;
    const uint32_t root = choose_root(query, u, weights, scale);
    if (root == kNoParent) return false;
    const ForestNode* node = &forest.nodes[root];
    sample.probability = 1;
    while (true) {
      const int lane = choose(weights, u);
      sample.probability *= weights.own[lane] / scale;
      const int32_t child = node->child[lane];
      if (child < 0) {
        sample.edge = {node->object, static_cast<uint32_t>(~child)};
        return true;
      }
      descend(*node, lane, query, weights);
      node = &forest.nodes[child];
      scale = weights.total();
      if (!(scale > 0)) return false;
    }
  }

  // Of drawing the child at a slot; multiplied from the root on, as `draw` does. Leaves the weights
  // of the slot's node.
  double probability(uint32_t slot, const ForestQuery& query, Weights& weights) const {
    const ForestNode& node = forest.nodes[slot / kWidth];
    double reach = 1, scale;
    if (node.parent == kNoParent) {
      scale = root_total(query);
      weigh(slot / kWidth, query, weights);
    } else {
      reach = probability(node.parent, query, weights);
      if (reach == 0) return 0;
      descend(forest.nodes[node.parent / kWidth], node.parent % kWidth, query, weights);
      scale = weights.total();
    }
    return scale > 0 ? reach * (weights.own[slot % kWidth] / scale) : 0;
  }

  // Exact test of a drawn edge.
  bool accepts(const EdgeQuery& query, EdgeId id) const {
    return is_candidate(input.objects[id.object], id.edge, query.p) &&
           !is_own_edge(input, query, id);
  }
  SeenEdge seen_edge(const LtcLobe& lobe, const Vec3d& p, EdgeId id) const {
    const EdgeMesh& mesh = input.objects[id.object];
    const auto [a, b] = mesh.edges[id.edge].vertices;
    return {lobe, mesh.positions[a] - p, mesh.positions[b] - p};
  }
};

EdgeForest::EdgeForest(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EdgeForest::~EdgeForest() = default;

std::unique_ptr<EdgeForest> EdgeForest::build(const EdgeSamplerInput& input, int threads,
                                              const ForestConfig& config) {
  // What is spread over directions weighs by itself.
  const bool spread = config.environment_term && input.environment;
  const double uniform_luminance = spread ? 0 : input.environment_luminance;
  auto impl =
      std::unique_ptr<Impl>(new Impl{input, config, LightClusters(input.lights, uniform_luminance),
                                     build_forest(input, threads, config)});
  return std::unique_ptr<EdgeForest>(new EdgeForest(std::move(impl)));
}

bool EdgeForest::sample(const EdgeQuery& query, Rng& rng, EdgeSample& sample) const {
  const double u_edge = rng.uniform(), u_t = rng.uniform();
  const ForestQuery prepared = impl_->prepare(query);
  if (!impl_->draw(prepared, u_edge, sample)) return false;
  if (!impl_->accepts(query, sample.edge)) return false;
  const SeenEdge edge = impl_->seen_edge(prepared.lobe, query.p, sample.edge);
  if (!(edge.is_seen())) return false;
  sample.t = edge.sample_t(u_t);
  sample.pdf_t = edge.pdf_t(sample.t);
  // Nothing where the density is lost to rounding, on an edge that lies in the horizon.
  return sample.pdf_t > 0;
}

double EdgeForest::probability(const EdgeQuery& query, EdgeId id) const {
  const uint32_t slot = impl_->forest.slots[id.object][id.edge];
  if (slot == kNoParent || !impl_->accepts(query, id)) return 0;
  const ForestQuery prepared = impl_->prepare(query);
  if (!(impl_->seen_edge(prepared.lobe, query.p, id).is_seen())) return 0;
  Weights weights;
  return impl_->probability(slot, prepared, weights);
}

double EdgeForest::pdf_t(const EdgeQuery& query, EdgeId id, double t) const {
  const SeenEdge edge = impl_->seen_edge(LtcLobe(query.lobe, query.n, query.wi), query.p, id);
  return edge.is_seen() ? edge.pdf_t(t) : 0;
}

uint64_t EdgeForest::list_silhouettes(const Vec3d& p, std::vector<EdgeId>& edges) const {
  const Forest& forest = impl_->forest;
  const ForestPoint point = point_of(forest, p);
  std::vector<uint32_t> stack(forest.roots.rbegin(), forest.roots.rend());
  uint64_t tested = 0;
  while (!stack.empty()) {
    const ForestNode& node = forest.nodes[stack.back()];
    stack.pop_back();
    ++tested;
    const Int4 alive = may_hold_candidates(node, point);
    for (int lane = kWidth - 1; lane >= 0; --lane)
      if (alive[lane] && node.child[lane] > 0)
        stack.push_back(static_cast<uint32_t>(node.child[lane]));
    for (int lane = 0; lane < kWidth; ++lane) {
      if (!alive[lane] || node.child[lane] >= 0) continue;
      const EdgeId id{node.object, static_cast<uint32_t>(~node.child[lane])};
      if (is_candidate(impl_->input.objects[id.object], id.edge, p)) edges.push_back(id);
    }
  }
  return tested;
}

uint64_t EdgeForest::bytes() const {
  const Forest& forest = impl_->forest;
  uint64_t sum = forest.nodes.size() * sizeof(ForestNode) + forest.roots.size() * sizeof(uint32_t);
  for (const auto& slots : forest.slots) sum += slots.size() * sizeof(uint32_t);
  return sum;
}

uint64_t EdgeForest::node_count() const { return impl_->forest.nodes.size(); }

}  // namespace limn
