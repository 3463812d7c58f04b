#include "limn/edgetree/edge_forest.h"

#include <algorithm>

#include "forest_build.h"
#include "forest_query.h"
#include "limn/edgetree/contribution_bound.h"
#include "samplers.h"

namespace limn {

struct EdgeForest::Impl {
  const EdgeSamplerInput& input;
  ForestConfig config;
  Forest forest;

  Float4 weigh(uint32_t node, const ForestQuery& query) const {
    return weigh_children(forest.nodes[node], query, config.soft_weights);
  }

  // Sum of a root's weights over those of all roots.
  double root_weight(uint32_t root, const ForestQuery& query) const {
    return total(weigh(root, query));
  }
  static double total(Float4 weights) {
    return (static_cast<double>(weights[0]) + weights[1]) +
           (static_cast<double>(weights[2]) + weights[3]);
  }
  double root_total(const ForestQuery& query) const {
    double sum = 0;
    for (uint32_t root : forest.roots) sum += root_weight(root, query);
    return sum;
  }

  // Exact test of a drawn edge.
  bool accepts(const EdgeQuery& query, EdgeId id) const {
    return is_candidate(input.objects[id.object], id.edge, query.p) &&
           !is_own_edge(input, query, id);
  }
  EdgeBound bound_of(const EdgeQuery& query, EdgeId id) const {
    return {LobeBound(query.n, query.wi, query.lobe),
            segment_of(input.objects[id.object], id.edge, query)};
  }

  // Of reaching a node, up to the factor 1 / root_total; multiplied from the root on, as `sample`
  // does.
  double probability_of_node(uint32_t node, const ForestQuery& query) const {
    const uint32_t parent = forest.nodes[node].parent;
    return parent == kNoParent ? 1 : probability_of_slot(parent, query);
  }
  double probability_of_slot(uint32_t slot, const ForestQuery& query) const {
    const uint32_t node = slot / kWidth;
    const Float4 weights = weigh(node, query);
    const double weight = weights[slot % kWidth];
    if (!(weight > 0)) return 0;
    if (forest.nodes[node].parent == kNoParent) return weight / root_total(query);
    const double reach = probability_of_node(node, query);
    return reach * (weight / total(weights));
  }
};

namespace {

// Draws a lane and leaves in u a new uniform number. weights: total > 0.
int choose(Float4 weights, double total, double& u) {
  double rest = u * total;
  int lane = 0;
  for (int i = 0; i < kWidth; ++i) {
    if (!(weights[i] > 0)) continue;
    lane = i;
    if (rest < weights[i]) break;
    if (i + 1 < kWidth) rest -= weights[i];
  }
  u = std::clamp(rest / weights[lane], 0.0, 0x1.fffffffffffffp-1);
  return lane;
}

}  // namespace

EdgeForest::EdgeForest(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
EdgeForest::~EdgeForest() = default;

std::unique_ptr<EdgeForest> EdgeForest::build(const EdgeSamplerInput& input, int threads,
                                              const ForestConfig& config) {
  auto impl = std::unique_ptr<Impl>(new Impl{input, config, build_forest(input, threads, config)});
  return std::unique_ptr<EdgeForest>(new EdgeForest(std::move(impl)));
}

bool EdgeForest::sample(const EdgeQuery& query, Rng& rng, EdgeSample& sample) const {
  const Forest& forest = impl_->forest;
  const ForestQuery prepared(forest, query, impl_->input.lane_scale);
  const double u_edge = rng.uniform(), u_piece = rng.uniform(), u_angle = rng.uniform();

  const double root_total = impl_->root_total(prepared);
  if (!(root_total > 0)) return false;
  double u = u_edge * root_total;
  uint32_t node = kNoParent;
  Float4 weights{};
  double total = 0;
  for (uint32_t root : forest.roots) {
    const Float4 root_weights = impl_->weigh(root, prepared);
    const double weight = Impl::total(root_weights);
    if (!(weight > 0)) continue;
    if (node != kNoParent) u -= total;
    node = root;
    weights = root_weights;
    total = weight;
    if (u < total) break;
  }
  u = std::clamp(u / total, 0.0, 0x1.fffffffffffffp-1);
  double probability = 1;
  for (double scale = root_total;; scale = total) {
    const int lane = choose(weights, total, u);
    probability *= weights[lane] / scale;
    const int32_t child = forest.nodes[node].child[lane];
    if (child < 0) {
      sample.edge = {forest.nodes[node].object, static_cast<uint32_t>(~child)};
      break;
    }
    node = static_cast<uint32_t>(child);
    weights = impl_->weigh(node, prepared);
    total = Impl::total(weights);
    if (!(total > 0)) return false;
  }
  if (!impl_->accepts(query, sample.edge)) return false;
  const EdgeBound bound = impl_->bound_of(query, sample.edge);
  if (!(bound.total() > 0)) return false;
  sample.t = bound.sample_t(u_piece, u_angle);
  sample.pdf_t = bound.pdf_t(sample.t);
  sample.probability = probability;
  return true;
}

double EdgeForest::probability(const EdgeQuery& query, EdgeId id) const {
  const uint32_t slot = impl_->forest.slots[id.object][id.edge];
  if (slot == kNoParent || !impl_->accepts(query, id)) return 0;
  if (!(impl_->bound_of(query, id).total() > 0)) return 0;
  return impl_->probability_of_slot(slot,
                                    ForestQuery(impl_->forest, query, impl_->input.lane_scale));
}

double EdgeForest::pdf_t(const EdgeQuery& query, EdgeId id, double t) const {
  const EdgeBound bound = impl_->bound_of(query, id);
  return bound.total() > 0 ? bound.pdf_t(t) : 0;
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

std::unique_ptr<EdgeSampler> make_forest_sampler(const EdgeSamplerInput& input, int threads) {
  return EdgeForest::build(input, threads);
}

}  // namespace limn
