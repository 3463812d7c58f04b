// Compares rejection trees with the exact test of every edge, and chooses what of them to inspect.
#include "limn/edgetree/rejection.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

Bounds bounds_of(const EdgeMesh& mesh) {
  Bounds bounds;
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices) bounds.extend(mesh.position(vertex));
  return bounds;
}

// Normals of the faces around the edges, for each edge once.
std::vector<Vec3d> normals_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges) {
  std::vector<Vec3d> normals;
  for (const EdgeRef id : edges) {
    const EdgeMesh& mesh = input.object(id.object);
    for (const FaceRef face : mesh.faces_around(id.edge))
      if (face.shape == mesh.shape) normals.push_back(mesh.plane(face.face).n);
  }
  return normals;
}

Vec3d mean(const std::vector<Vec3d>& vectors) {
  Vec3d sum;
  for (const Vec3d& v : vectors) sum += v;
  return sum / static_cast<double>(vectors.size());
}

// The unit tangent along which the vectors vary most: the larger principal axis of their second
// moments in the tangent plane of n.
Vec3d widest_tangent(const std::vector<Vec3d>& vectors, const Vec3d& n) {
  const Frame frame(n);
  double ss = 0, st = 0, tt = 0;
  for (const Vec3d& v : vectors) {
    const Vec3d local = frame.to_local(v);
    ss += local.x * local.x;
    st += local.x * local.y;
    tt += local.y * local.y;
  }
  const double angle = 0.5 * std::atan2(2 * st, ss - tt);
  return frame.s * std::cos(angle) + frame.t * std::sin(angle);
}

// Distance of two counts: the logarithm of their ratio.
double misfit(uint32_t a, uint32_t b) { return std::fabs(std::log(static_cast<double>(a) / b)); }

// Nodes within a factor of 3/2 of the number of edges, or else the closest.
std::vector<uint32_t> nodes_of_size(const RejectionTree& tree, uint32_t edges) {
  const auto nodes = tree.nodes();
  double limit = std::log(1.5), nearest = std::numeric_limits<double>::infinity();
  for (const RejectionNode& node : nodes)
    nearest = std::min(nearest, misfit(node.end - node.begin, edges));
  limit = std::max(limit, nearest);
  std::vector<uint32_t> fitting;
  for (uint32_t i = 0; i < nodes.size(); ++i)
    if (misfit(nodes[i].end - nodes[i].begin, edges) <= limit) fitting.push_back(i);
  return fitting;
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

Vec3d random_direction(Rng& rng) {
  const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

double radius_of(const EdgeMesh& mesh) {
  const Vec3d center = bounds_of(mesh).center();
  double radius = 0;
  for (const Edge& edge : mesh.edges)
    for (const VertexId vertex : edge.vertices)
      radius = std::max(radius, length(mesh.position(vertex) - center));
  return radius;
}

std::vector<EdgeQuery> queries_around(const EdgeMesh& mesh, int count, uint64_t seed) {
  const Vec3d center = bounds_of(mesh).center();
  const double radius = radius_of(mesh);
  Rng rng(seed, 0, 0);
  std::vector<EdgeQuery> queries;
  for (int i = 0; i < count; ++i) {
    const Vec3d direction = random_direction(rng);
    EdgeQuery query;
    query.p = center + direction * (1.5 * radius);
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

uint32_t balanced_node(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t edges,
                       std::span<const EdgeQuery> queries) {
  uint32_t best = 0;
  double least = std::numeric_limits<double>::infinity();
  for (const uint32_t i : nodes_of_size(tree, edges)) {
    const auto own = tree.edges(i);
    const auto holds = std::count_if(queries.begin(), queries.end(), [&](const EdgeQuery& query) {
      return std::any_of(own.begin(), own.end(), [&](EdgeRef id) {
        return is_candidate(input.object(id.object), id.edge, query.p);
      });
    });
    const double off = std::fabs(static_cast<double>(holds) - 0.5 * queries.size());
    if (off < least) {
      least = off;
      best = i;
    }
  }
  return best;
}

Match best_match(const EdgeSamplerInput& input, const RejectionTree& tree,
                 std::span<const EdgeRef> edges) {
  std::vector<std::vector<bool>> wanted;
  for (const EdgeMesh& mesh : input.objects) wanted.emplace_back(mesh.edges.size(), false);
  for (const EdgeRef id : edges) wanted[id.object.index()][id.edge.index()] = true;
  std::vector<uint32_t> running{0};
  for (const EdgeRef id : tree.edges())
    running.push_back(running.back() + (wanted[id.object.index()][id.edge.index()] ? 1 : 0));
  Match best;
  for (uint32_t i = 0; i < tree.nodes().size(); ++i) {
    const RejectionNode& node = tree.nodes()[i];
    const double common = running[node.end] - running[node.begin];
    const double either = static_cast<double>(edges.size()) + (node.end - node.begin) - common;
    if (common / either > best.overlap) best = {i, common / either};
  }
  return best;
}

Patch patch_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges) {
  Bounds bounds;
  for (const EdgeRef id : edges) {
    const EdgeMesh& mesh = input.object(id.object);
    for (const VertexId vertex : mesh.edge(id.edge).vertices) bounds.extend(mesh.position(vertex));
  }
  const std::vector<Vec3d> normals = normals_of(input, edges);
  const Vec3d sum = mean(normals);
  const Vec3d n = length(sum) > 0 ? normalize(sum) : Vec3d{0, 0, 1};
  const Vec3d bend = widest_tangent(normals, n);
  return {bounds.center(), 0.5 * bounds.diagonal(), n, bend, cross(bend, n)};
}

std::array<Slice, 2> slices_around(const Patch& patch, double extent, double distance, int size) {
  const Slice first{patch.center, patch.bend * extent, patch.normal * extent, size};
  Slice second = first;
  second.center += patch.across * distance;
  return {first, second};
}

}  // namespace limn
