// Compares rejection trees with the exact test of every edge.
#include "limn/edgetree/rejection.h"

#include <algorithm>
#include <cmath>

#include "limn/core/parallel.h"

namespace limn {
namespace {

bool is_candidate(const EdgeSamplerInput& input, EdgeRef id, const Vec3d& p) {
  return limn::is_candidate(input.object(id.object), id.edge, p);
}

// Number of edges of E(p) among the first i of a tree.
std::vector<uint32_t> running_candidates(const EdgeSamplerInput& input, const RejectionTree& tree,
                                         const Vec3d& p) {
  std::vector<uint32_t> running{0};
  running.reserve(tree.edges().size() + 1);
  for (const EdgeRef id : tree.edges())
    running.push_back(running.back() + (is_candidate(input, id, p) ? 1 : 0));
  return running;
}

void add(std::vector<DepthCounts>& sums, const std::vector<DepthCounts>& counts) {
  sums.resize(std::max(sums.size(), counts.size()));
  for (size_t d = 0; d < counts.size(); ++d) {
    sums[d].tested += counts[d].tested;
    sums[d].accepted += counts[d].accepted;
    sums[d].false_accepts += counts[d].false_accepts;
    sums[d].missed += counts[d].missed;
  }
}

// The edges of E(p) that were not reached, in order.
std::vector<EdgeRef> not_reached(const EdgeSamplerInput& input, const std::vector<EdgeRef>& reached,
                                 const Vec3d& p) {
  std::vector<std::vector<bool>> known;
  for (const EdgeMesh& mesh : input.objects) known.emplace_back(mesh.edges.size(), false);
  for (const EdgeRef id : reached) known[id.object.index()][id.edge.index()] = true;
  std::vector<EdgeRef> rest;
  for (uint32_t o = 0; o < input.objects.size(); ++o)
    for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e) {
      const EdgeRef id{ShapeId(o), EdgeId(e)};
      if (!known[o][e] && is_candidate(input, id, p)) rest.push_back(id);
    }
  return rest;
}

Vec3d random_direction(Rng& rng) {
  const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace

NodeVerdict judge(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t node,
                  const Vec3d& p) {
  const auto edges = tree.edges(node);
  const bool holds = std::any_of(edges.begin(), edges.end(),
                                 [&](EdgeRef id) { return is_candidate(input, id, p); });
  if (tree.rejects(node, p)) return holds ? NodeVerdict::kMissed : NodeVerdict::kTrueReject;
  return holds ? NodeVerdict::kTrueAccept : NodeVerdict::kFalseAccept;
}

std::vector<NodeVerdict> judge_slice(const EdgeSamplerInput& input, const RejectionTree& tree,
                                     uint32_t node, const Slice& slice, int threads) {
  const auto size = static_cast<size_t>(slice.size);
  std::vector<NodeVerdict> verdicts(size * size);
  parallel_for(size, threads, [&](size_t y) {
    for (size_t x = 0; x < size; ++x) {
      const Vec3d p = slice.point(static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
      verdicts[y * size + x] = judge(input, tree, node, p);
    }
  });
  return verdicts;
}

VerdictCounts count(std::span<const NodeVerdict> verdicts) {
  VerdictCounts counts{};
  for (const NodeVerdict verdict : verdicts) ++counts[static_cast<int>(verdict)];
  return counts;
}

Reach reach_from(const EdgeSamplerInput& input, const RejectionTree& tree, const Vec3d& p) {
  const std::vector<uint32_t> running = running_candidates(input, tree, p);
  const auto nodes = tree.nodes();
  Reach reach;
  for (uint32_t i = 0; i < nodes.size();) {
    const RejectionNode& node = nodes[i];
    const bool holds = running[node.end] > running[node.begin];
    const bool accepted = !tree.rejects(i, p);
    if (node.depth > reach.by_depth.size()) reach.by_depth.resize(node.depth);
    DepthCounts& counts = reach.by_depth[node.depth - 1];
    ++counts.tested;
    counts.accepted += accepted;
    counts.false_accepts += accepted && !holds;
    counts.missed += !accepted && holds;
    if (accepted && node.after == i + 1)
      (holds ? reach.silhouettes : reach.false_accepts).push_back(tree.edges()[node.begin]);
    i = accepted ? i + 1 : node.after;
  }
  reach.missed = not_reached(input, reach.silhouettes, p);
  return reach;
}

ReachCounts count_reach(const EdgeSamplerInput& input, const RejectionTree& tree,
                        std::span<const EdgeQuery> queries, int threads) {
  std::vector<ReachCounts> counts(queries.size());
  parallel_for(queries.size(), threads, [&](size_t i) {
    Reach reach = reach_from(input, tree, queries[i].p);
    counts[i] = {1, reach.silhouettes.size(), reach.false_accepts.size(), reach.missed.size(),
                 std::move(reach.by_depth)};
  });
  ReachCounts sum;
  for (const ReachCounts& one : counts) {
    sum.points += one.points;
    sum.silhouettes += one.silhouettes;
    sum.false_accepts += one.false_accepts;
    sum.missed += one.missed;
    add(sum.by_depth, one.by_depth);
  }
  return sum;
}

std::vector<EdgeQuery> queries_around(const EdgeMesh& mesh, int count, uint64_t seed) {
  Bounds bounds;
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices) bounds.extend(mesh.position(vertex));
  double radius = 0;
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices)
      radius = std::max(radius, length(mesh.position(vertex) - bounds.center()));
  Rng rng(seed, 0, 0);
  std::vector<EdgeQuery> queries;
  for (int i = 0; i < count; ++i) {
    const Vec3d direction = random_direction(rng);
    EdgeQuery query;
    query.p = bounds.center() + direction * (1.5 * radius);
    query.n = query.wi = -direction;
    const Vec3d velocity = random_direction(rng);
    for (int k = 0; k < 3; ++k) query.velocity[k][0] = -velocity[k];
    queries.push_back(query);
  }
  return queries;
}

AcceptanceRate acceptance_rate(const EdgeSampler& sampler, std::span<const EdgeQuery> queries,
                               int draws, uint64_t seed, int threads) {
  std::vector<double> shares(queries.size());
  parallel_for(queries.size(), threads, [&](size_t i) {
    Rng rng(seed, i, 0);
    int hits = 0;
    for (int k = 0; k < draws; ++k) hits += sampler.sample(queries[i], rng).has_value();
    shares[i] = static_cast<double>(hits) / draws;
  });
  const auto n = static_cast<double>(shares.size());
  double sum = 0, squares = 0;
  for (const double share : shares) sum += share;
  const double mean = sum / n;
  for (const double share : shares) squares += (share - mean) * (share - mean);
  return {mean, std::sqrt(squares / (n * (n - 1)))};
}

}  // namespace limn
