// What samplers reject: trees in order, verdicts over slices and reach against tests of every edge,
// and that nothing is missed.
#include "limn/edgetree/rejection.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "../support/meshes.h"
#include "../support/test_names.h"
#include "edgetree/forest/edge_forest.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

// Fixed seeds: a z-score beyond this (chance 6e-7) is an error, not luck.
constexpr double kLargestZ = 5;

bool holds_candidate(const EdgeSamplerInput& input, std::span<const EdgeRef> edges,
                     const Vec3d& p) {
  return std::any_of(edges.begin(), edges.end(),
                     [&](EdgeRef id) { return is_candidate(input.object(id.object), id.edge, p); });
}

// Two edges below one node; what it rejects is up to the test.
class PairTree final : public RejectionTree {
 public:
  using Test = std::function<bool(uint32_t node, const Vec3d& p)>;
  PairTree(EdgeRef a, EdgeRef b, Test rejects) : rejects_(std::move(rejects)) {
    nodes_ = {{kNoNode, 3, 1, 0, 2}, {0, 2, 2, 0, 1}, {0, 3, 2, 1, 2}};
    edges_ = {a, b};
  }
  bool rejects(uint32_t node, const Vec3d& p) const override { return rejects_(node, p); }

 private:
  Test rejects_;
};

// The two diagonals of a roof over the square [-1, 1]^2: a ridge along y at z = 0 whose sides fall
// at 45 degrees. The ridge is the one smooth edge; its planes are z = -|x|.
EdgeSamplerInput roof() {
  const Mesh mesh = with_smooth_normals(
      make_mesh({{0, -1, 0}, {0, 1, 0}, {1, 0, -1}, {-1, 0, -1}}, {{0, 2, 1}, {0, 1, 3}}));
  return {{build_edge_mesh(mesh, true)}};
}
EdgeRef ridge_of(const EdgeSamplerInput& input) {
  const auto& edges = input.objects[0].edges;
  const auto smooth = std::find_if(edges.begin(), edges.end(), [](const Edge& edge) {
    return edge.edge_class == EdgeClass::kSmooth;
  });
  return {ShapeId(0), EdgeId(static_cast<uint32_t>(smooth - edges.begin()))};
}

// Across the ridge: the planes of the roof are the diagonals of the slice, and p lies between them
// in the left and right quarters.
TEST(Slice, CountsOfARoofAreKnown) {
  const EdgeSamplerInput input = roof();
  const EdgeRef ridge = ridge_of(input);
  const Slice slice{{0, 0, 0}, {3, 0, 0}, {0, 0, 3}, 64};
  // Pixels on the two diagonals lie on a plane, and count as between.
  const uint64_t all = 64 * 64, between = (all - 128) / 2 + 128;
  const auto counts = [&](const PairTree::Test& test) {
    return count(judge_slice(input, PairTree(ridge, ridge, test), 0, slice, 2));
  };
  const auto never = [](uint32_t, const Vec3d&) { return false; };
  const auto always = [](uint32_t, const Vec3d&) { return true; };
  const auto above = [](uint32_t, const Vec3d& p) { return p.z > 0; };
  EXPECT_EQ(counts(never), (VerdictCounts{0, between, all - between, 0}));
  EXPECT_EQ(counts(always), (VerdictCounts{all - between, 0, 0, between}));
  EXPECT_EQ(counts(above),
            (VerdictCounts{(all - between) / 2, between / 2, (all - between) / 2, between / 2}));
}

TEST(Slice, RowZeroIsOnTop) {
  const Slice slice{{1, 2, 3}, {2, 0, 0}, {0, 0, 2}, 4};
  EXPECT_EQ(slice.point(0, 0), (Vec3d{-1, 2, 5}));
  EXPECT_EQ(slice.point(4, 4), (Vec3d{3, 2, 1}));
  const EdgeSamplerInput input = roof();
  const EdgeRef ridge = ridge_of(input);
  const PairTree tree(ridge, ridge, [](uint32_t, const Vec3d& p) { return p.z > 4 && p.x < 0; });
  const auto verdicts = judge_slice(input, tree, 0, slice, 1);
  EXPECT_EQ(verdicts[0], NodeVerdict::kTrueReject);
  for (const int i : {1, 4, 15}) EXPECT_NE(verdicts[i], NodeVerdict::kTrueReject) << i;
}

TEST(Reach, TellsEndsFromDeadEndsAndLosses) {
  const EdgeSamplerInput input = roof();
  const EdgeRef ridge = ridge_of(input),
                border{ShapeId(0), EdgeId(ridge.edge == EdgeId(0) ? 1 : 0)};
  const uint32_t borders = input.objects[0].edges.size() - 2;  // but for ridge and `border`
  const Vec3d above{0, 0, 5}, aside{5, 0, 0};                  // the ridge counts for the second
  const auto reach = [&](const Vec3d& p, bool top, bool first, bool second) {
    const bool rejected[] = {top, first, second};
    return reach_from(
        input, PairTree(ridge, border, [&](uint32_t i, const Vec3d&) { return rejected[i]; }), p);
  };
  const Reach all = reach(above, false, false, false);
  EXPECT_EQ(all.silhouettes, std::vector{border});
  EXPECT_EQ(all.false_accepts, std::vector{ridge});
  EXPECT_EQ(all.missed.size(), borders);
  EXPECT_EQ(all.by_depth[0].false_accepts, 0u);
  EXPECT_EQ(all.by_depth[1].tested, 2u);
  EXPECT_EQ(all.by_depth[1].false_accepts, 1u);

  const Reach dead_end = reach(aside, false, true, true);
  EXPECT_EQ(dead_end.missed.size(), borders + 2);
  EXPECT_EQ(dead_end.by_depth[1].missed, 2u);

  const Reach nothing = reach(aside, true, false, false);
  EXPECT_TRUE(nothing.silhouettes.empty());
  EXPECT_EQ(nothing.by_depth.size(), 1u);
  EXPECT_EQ(nothing.by_depth[0].missed, 1u);
}

// Every sampler that rejects, over every mesh.
class RejectingSamplers : public testing::TestWithParam<EdgeSamplerType> {
 protected:
  static EdgeSamplerInput input_of(const Mesh& mesh) {
    const Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    return {
        {build_edge_mesh(mesh, true),
         build_edge_mesh(transformed(mesh, identity, 0.5, {1.2, 0.1, -0.4}), true, ShapeId(1))}};
  }
};

TEST_P(RejectingSamplers, TreesAreInOrder) {
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeSamplerInput input = input_of(mesh);
    const auto sampler = GetParam().make(input, 1);
    const auto tree = sampler->rejection_tree();
    const auto nodes = tree->nodes();
    uint32_t edges = 0;
    for (uint32_t i = 0; i < nodes.size(); ++i) {
      const RejectionNode& node = nodes[i];
      ASSERT_LT(node.begin, node.end);
      if (node.parent == RejectionTree::kNoNode) {
        EXPECT_EQ(node.depth, 1u);
      } else {
        const RejectionNode& parent = nodes[node.parent];
        EXPECT_EQ(node.depth, parent.depth + 1);
        EXPECT_TRUE(node.parent < i && node.after <= parent.after);
        EXPECT_TRUE(node.begin >= parent.begin && node.end <= parent.end);
      }
      if (node.after == i + 1) {
        EXPECT_EQ(node.begin, edges++);
        EXPECT_EQ(node.end, edges);
      }
    }
    EXPECT_EQ(edges, tree->edges().size());
    std::vector<std::vector<bool>> seen;
    for (const EdgeMesh& object : input.objects) seen.emplace_back(object.edges.size(), false);
    for (const EdgeRef id : tree->edges()) {
      EXPECT_FALSE(seen[id.object.index()][id.edge.index()]);
      seen[id.object.index()][id.edge.index()] = true;
    }
  }
}

TEST_P(RejectingSamplers, SlicesAgreeWithTestsOfEveryEdge) {
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeSamplerInput input = input_of(mesh);
    const auto sampler = GetParam().make(input, 1);
    const auto tree = sampler->rejection_tree();
    const auto queries = queries_around(input.objects[0], 16, 1);
    for (const uint32_t size : {4, 16, 64}) {
      const uint32_t node = balanced_node(input, *tree, size, queries);
      const Patch patch = patch_of(input, tree->edges(node));
      for (const Slice& slice : slices_around(patch, 2, 0.5, 24)) {
        VerdictCounts counts{};
        for (int k = 0; k < 24 * 24; ++k) {
          const Vec3d p = slice.point(k % 24 + 0.5, k / 24 + 0.5);
          const bool holds = holds_candidate(input, tree->edges(node), p);
          ++counts[tree->rejects(node, p) ? (holds ? 3 : 0) : (holds ? 1 : 2)];
        }
        EXPECT_EQ(counts[3], 0u) << name << ": missed silhouettes";
        EXPECT_EQ(count(judge_slice(input, *tree, node, slice, 3)), counts) << name;
      }
    }
  }
}

TEST_P(RejectingSamplers, DescentsReachAllSilhouettes) {
  Rng rng(31, 0, 0);
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeSamplerInput input = input_of(mesh);
    const auto sampler = GetParam().make(input, 1);
    const auto tree = sampler->rejection_tree();
    for (int i = 0; i < 40; ++i) {
      const Vec3d p = random_direction(rng) * (3 * rng.uniform());
      const Reach reach = reach_from(input, *tree, p);
      EXPECT_TRUE(reach.missed.empty()) << name << ": missed " << reach.missed.size();
      uint64_t candidates = 0, false_accepts = 0;
      for (const EdgeMesh& object : input.objects)
        for (uint32_t e = 0; e < object.edges.size(); ++e)
          candidates += is_candidate(object, EdgeId(e), p);
      EXPECT_EQ(reach.silhouettes.size(), candidates) << name;
      for (const EdgeRef id : reach.false_accepts)
        EXPECT_FALSE(is_candidate(input.object(id.object), id.edge, p)) << name;
      // Counted from the other side: nodes whose ancestors and themselves are accepted in vain.
      for (const DepthCounts& counts : reach.by_depth) false_accepts += counts.false_accepts;
      const auto nodes = tree->nodes();
      std::vector<bool> accepted(nodes.size());
      for (uint32_t k = 0; k < nodes.size(); ++k) {
        const uint32_t parent = nodes[k].parent;
        accepted[k] =
            (parent == RejectionTree::kNoNode || accepted[parent]) && !tree->rejects(k, p);
        if (accepted[k] && !holds_candidate(input, tree->edges(k), p)) --false_accepts;
      }
      EXPECT_EQ(false_accepts, 0u) << name;
    }
  }
}

// The share of draws that succeed is the sum of all edges' probabilities.
TEST_P(RejectingSamplers, HitRateIsTheSumOfProbabilities) {
  for (const auto& [name, mesh] : test_meshes()) {
    EdgeSamplerInput input{{build_edge_mesh(mesh, true)}};
    const auto sampler = GetParam().make(input, 1);
    const auto queries = queries_around(input.objects[0], 12, 2);
    constexpr int kDraws = 400;
    double expected = 0, variance = 0;
    for (const EdgeQuery& query : queries) {
      double sum = 0;
      for (uint32_t e = 0; e < input.objects[0].edges.size(); ++e)
        sum += sampler->probability(query, {ShapeId(0), EdgeId(e)});
      expected += sum / queries.size();
      variance += sum * (1 - sum) / (kDraws * queries.size() * queries.size());
    }
    const AcceptanceRate hits = acceptance_rate(*sampler, queries, kDraws, 3, 2);
    // Where every draw hits, probabilities add up to 1 but for the rounding of each.
    const double rounding = static_cast<double>(input.objects[0].edges.size()) * 0x1.0p-50;
    EXPECT_LE(std::fabs(hits.mean - expected),
              kLargestZ * std::sqrt(std::max(variance, 0.0)) + rounding)
        << name;
    EXPECT_EQ(acceptance_rate(*sampler, queries, kDraws, 3, 1).mean, hits.mean) << name;
  }
}

std::vector<EdgeSamplerType> rejecting_samplers() {
  std::vector<EdgeSamplerType> types;
  const EdgeSamplerInput input = {{build_edge_mesh(cube_mesh(), true)}};
  for (const EdgeSamplerType& row : edge_sampler_types()) {
    std::vector<std::string> names = variants_of(row);
    names.insert(names.begin(), row.name);
    for (const std::string& name : names) {
      const EdgeSamplerType type = edge_sampler_type(name);
      if (type.make(input, 1)->rejection_tree()) types.push_back(type);
    }
  }
  return types;
}
INSTANTIATE_TEST_SUITE_P(All, RejectingSamplers, testing::ValuesIn(rejecting_samplers()),
                         [](const auto& test) { return test_name(test.param.name); });

TEST(RejectionTree, ForestsAndLiHaveOneOthersDoNot) {
  std::vector<std::string> names;
  for (const EdgeSamplerType& type : rejecting_samplers()) names.push_back(type.name);
  EXPECT_NE(std::find(names.begin(), names.end(), "forest"), names.end());
  EXPECT_NE(std::find(names.begin(), names.end(), "li2019"), names.end());
  EXPECT_NE(std::find(names.begin(), names.end(), "brute:search=dual-bvh"), names.end());
  EXPECT_EQ(std::find(names.begin(), names.end(), "brute"), names.end());
}

using Planes = std::vector<std::array<double, 4>>;  // n, distance of the origin

// The planes of the faces at these edges, seen from an origin.
Planes planes_of(const EdgeMesh& mesh, std::span<const EdgeRef> edges, const Vec3d& origin) {
  Planes planes;
  for (const EdgeRef id : edges) {
    for (const FaceId face : mesh.edge(id.edge).faces) {
      const Plane& plane = mesh.plane(face);
      planes.push_back({plane.n.x, plane.n.y, plane.n.z, plane.distance(origin)});
    }
  }
  return planes;
}

struct Interval {
  double middle, half;
};
// Of the values of a function of planes, wider by a factor.
template <class F>
Interval interval_of(const Planes& planes, double wider, F f) {
  double low = f(planes[0]), high = low;
  for (const auto& plane : planes) low = std::min(low, f(plane)), high = std::max(high, f(plane));
  return {0.5 * (low + high), 0.5 * wider * (high - low)};
}

// Nowrouzezahrai et al. 2014: no plane of the box goes through w.
bool misses_dual_box(const Planes& planes, const Vec3d& w, double radius, double wider) {
  const double x[4] = {w.x / radius, w.y / radius, w.z / radius, 1};
  double middle = 0, reach = 0;
  for (int i = 0; i < 4; ++i) {
    const Interval box =
        interval_of(planes, wider, [&](const auto& q) { return i < 3 ? q[i] : q[3] / radius; });
    middle += box.middle * x[i];
    reach += box.half * std::fabs(x[i]);
  }
  return std::fabs(middle) > reach;
}

// Li et al. 2018: the sphere over the segment from the origin to w misses the box of the feet of
// the planes.
bool misses_hough_box(const Planes& planes, const Vec3d& w, double wider) {
  double nearest = 0, farthest = 0;
  for (int i = 0; i < 3; ++i) {
    const Interval box = interval_of(planes, wider, [&](const auto& q) { return -q[i] * q[3]; });
    const double away = std::fabs(box.middle - 0.5 * w[i]);
    nearest += std::pow(std::max(away - box.half, 0.0), 2);
    farthest += std::pow(away + box.half, 2);
  }
  const double radius = 0.5 * length(w);
  return nearest > radius * radius || farthest < radius * radius;
}

// Nodes reject what a box around their planes would miss that were wider by a tenth.
TEST(RejectionTree, BoxesOfPlanesAreTight) {
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(30, 20)), true)}};
  const EdgeMesh& mesh = input.objects[0];
  Bounds bounds;
  for (const Vec3d& x : mesh.positions) bounds.extend(x);
  for (const char* name : {"brute:search=dual-bvh", "li2019"}) {
    Rng rng(33, 0, 0);
    const auto sampler = make_edge_sampler(name, input, 1);
    const auto tree = sampler->rejection_tree();
    int missed = 0;
    for (uint32_t node = 0; node < tree->nodes().size(); ++node) {
      const auto smooth = [&](EdgeRef id) {
        return mesh.edge(id.edge).edge_class == EdgeClass::kSmooth;
      };
      if (!std::ranges::all_of(tree->edges(node), smooth)) continue;
      const Planes planes = planes_of(mesh, tree->edges(node), bounds.center());
      for (int i = 0; i < 20; ++i) {
        const Vec3d p = random_direction(rng) * (3 * rng.uniform()), w = p - bounds.center();
        const bool misses = name == std::string("li2019")
                                ? misses_hough_box(planes, w, 1.1)
                                : misses_dual_box(planes, w, 0.5 * bounds.diagonal(), 1.1);
        if (!misses) continue;
        ++missed;
        EXPECT_TRUE(tree->rejects(node, p)) << name << " " << node;
      }
    }
    EXPECT_GT(missed, 1000) << name;
  }
}

TEST(ReachCounts, AreSumsOverPoints) {
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(20, 10)), true)}};
  const auto sampler = make_edge_sampler("li2019", input, 1);
  const auto tree = sampler->rejection_tree();
  const auto queries = queries_around(input.objects[0], 10, 4);
  const ReachCounts counts = count_reach(input, *tree, queries, 3);
  ReachCounts sums;
  for (const EdgeQuery& query : queries) {
    const Reach reach = reach_from(input, *tree, query.p);
    sums.silhouettes += reach.silhouettes.size();
    sums.false_accepts += reach.false_accepts.size();
    sums.by_depth.resize(std::max(sums.by_depth.size(), reach.by_depth.size()));
    for (size_t d = 0; d < reach.by_depth.size(); ++d)
      sums.by_depth[d].accepted += reach.by_depth[d].accepted;
  }
  EXPECT_EQ(counts.points, 10u);
  EXPECT_EQ(counts.silhouettes, sums.silhouettes);
  EXPECT_EQ(counts.false_accepts, sums.false_accepts);
  EXPECT_EQ(counts.missed, 0u);
  ASSERT_EQ(counts.by_depth.size(), sums.by_depth.size());
  for (size_t d = 0; d < sums.by_depth.size(); ++d)
    EXPECT_EQ(counts.by_depth[d].accepted, sums.by_depth[d].accepted);
}

TEST(Places, TheBestMatchOfANodeIsItself) {
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(20, 10)), true)}};
  const auto forest = make_edge_sampler("forest", input, 1);
  const auto li = make_edge_sampler("li2019", input, 1);
  const auto tree = forest->rejection_tree(), other = li->rejection_tree();
  for (uint32_t i = 0; i < tree->nodes().size(); i += 7) {
    const Match own = best_match(input, *tree, tree->edges(i));
    EXPECT_EQ(own.node, i);
    EXPECT_EQ(own.overlap, 1);
    const Match match = best_match(input, *other, tree->edges(i));
    EXPECT_GT(match.overlap, 0);
    EXPECT_LE(match.overlap, 1);
  }
}

// Half of a tube along y: normals vary along x, and not along y. Positions are floats.
TEST(Places, APatchBendsAcrossATube) {
  Mesh mesh = grid_mesh(12);
  for (Vec3f& x : mesh.positions) x = {std::sin(x.x), 2 * x.y, std::cos(x.x)};
  weld_positions(mesh);
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(mesh), true)}};
  std::vector<EdgeRef> edges(input.objects[0].edges.size());
  for (uint32_t e = 0; e < edges.size(); ++e) edges[e] = {ShapeId(0), EdgeId(e)};
  const Patch patch = patch_of(input, edges);
  EXPECT_NEAR(patch.normal.z, 1, 1e-6);
  EXPECT_NEAR(std::fabs(patch.bend.x), 1, 1e-6);
  EXPECT_NEAR(std::fabs(patch.across.y), 1, 1e-6);
  const auto slices = slices_around(patch, 3, 0.7, 8);
  EXPECT_NEAR(length(slices[1].center - slices[0].center), 0.7, 1e-12);
  EXPECT_NEAR(dot(slices[1].center - slices[0].center, slices[0].up), 0, 1e-12);
  EXPECT_NEAR(length(slices[0].right), 3, 1e-12);
}

}  // namespace
}  // namespace limn
