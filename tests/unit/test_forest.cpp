// The edge forest rejects no edge of E(p): its listing against the exact test of every edge.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cfloat>
#include <cmath>
#include <cstring>

#include "../support/forest_fault.h"
#include "../support/hard_meshes.h"
#include "../support/meshes.h"
#include "../support/running_mean.h"
#include "../support/scaled_sampler.h"
#include "edgetree/forest/edge_forest.h"
#include "edgetree/forest/forest_build.h"
#include "edgetree/forest/forest_query.h"
#include "limn/edgetree/contribution_bound.h"
#include "limn/edgetree/rejection.h"
#include "support/edge_mesh_fault.h"

namespace limn {
namespace {

// All of E(p) that descents can reach.
std::vector<EdgeRef> silhouettes_of(const EdgeForest& forest, const EdgeSamplerInput& input,
                                    const Vec3d& p) {
  return reach_from(input, *forest.rejection_tree(), p).silhouettes;
}

void expect_complete(const EdgeSamplerInput& input, const EdgeForest& forest, const Vec3d& p,
                     const std::string& name) {
  std::vector<std::vector<bool>> found;
  for (const EdgeMesh& mesh : input.objects) found.emplace_back(mesh.edges.size(), false);
  for (EdgeRef id : silhouettes_of(forest, input, p)) {
    EXPECT_FALSE(found[id.object.index()][id.edge.index()]) << name << ": listed twice";
    found[id.object.index()][id.edge.index()] = true;
  }
  for (uint32_t o = 0; o < input.objects.size(); ++o)
    for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e)
      EXPECT_EQ(found[o][e], is_candidate(input.objects[o], EdgeId(e), p))
          << name << " object " << o << " edge " << e << " p " << p.x << " " << p.y << " " << p.z;
}

class Forests : public testing::TestWithParam<ForestConfig> {};

// points: of each of six scenes per mesh. Returns the number of pairs of point and edge.
uint64_t expect_no_edge_lost(const ForestConfig& config, uint64_t seed, int points) {
  Rng rng(seed, 0, 0);
  uint64_t pairs = 0;
  for (const auto& [name, mesh] : meshes_of_all_kinds(rng)) {
    for (int i = 0; i < 6; ++i) {
      const auto [input, scale] = placed_twice(mesh, i, rng);
      const auto forest = EdgeForest::build(input, 1, config);
      for (int k = 0; k < points; ++k)
        expect_complete(input, *forest, random_point(input.objects[k % 2], scale, rng), name);
      for (const EdgeMesh& object : input.objects) pairs += object.edges.size() * points;
      if (testing::Test::HasFailure()) return pairs;
    }
  }
  return pairs;
}

TEST_P(Forests, ListWhatTheExactTestLists) {
  EXPECT_GT(expect_no_edge_lost(GetParam(), 21, 60), 1000000u);
}

// The planes of a cone around an axis, a pyramid of three to eight sides, sometimes a sliver.
DirectionCone random_cone(const Vec3d& axis, Rng& rng) {
  DirectionCone cone;
  const Frame frame(axis);
  const int sides = 3 + static_cast<int>(rng.uniform() * 6);
  const double wide = std::exp(std::log(1e-2) * rng.uniform());
  const double flat = rng.uniform() < 0.3 ? 1e-3 : 1;
  for (int i = 0; i < sides; ++i) {
    const double a = 2 * kPi * (i + 0.5 * rng.uniform()) / sides;
    cone.add(normalize(frame.to_world({std::cos(a), std::sin(a) / flat, wide})));
  }
  cone.slack = rng.uniform() < 0.5 ? 0 : 1e-3 * rng.uniform();
  return cone;
}

struct Count {
  int wanted = 0, listed = 0;
};

void expect_outlines(const EdgeSamplerInput& input, const EdgeForest& forest,
                     const EdgeQuery& query, const DirectionCone& cone, const std::string& name,
                     Count& count) {
  std::vector<ListedEdge> listed;
  EXPECT_TRUE(forest.list_outlines(query, cone, listed));
  std::vector<std::vector<bool>> found;
  for (const EdgeMesh& mesh : input.objects) found.emplace_back(mesh.edges.size(), false);
  for (const ListedEdge& edge : listed) {
    const EdgeMesh& mesh = input.object(edge.id.object);
    const auto [a, b] = mesh.edge(edge.id.edge).vertices;
    EXPECT_TRUE(edge.x0 == mesh.position(a) && edge.x1 == mesh.position(b)) << name;
    EXPECT_TRUE(is_outline(mesh, edge.id.edge, query.p)) << name;
    EXPECT_FALSE(is_own_edge(input, query, edge.id)) << name;
    EXPECT_FALSE(found[edge.id.object.index()][edge.id.edge.index()]) << name << ": listed twice";
    found[edge.id.object.index()][edge.id.edge.index()] = true;
  }
  count.listed += static_cast<int>(listed.size());
  for (uint32_t o = 0; o < input.objects.size(); ++o) {
    const EdgeMesh& mesh = input.objects[o];
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      const EdgeRef id{ShapeId(o), EdgeId(e)};
      const auto [i, j] = mesh.edge(id.edge).vertices;
      const Vec3d a = mesh.position(i) - query.p, b = mesh.position(j) - query.p;
      const bool moves =
          !mesh.tangents.empty() || !is_zero(query.velocity.x) || !is_zero(query.turn.rate.y);
      double t0 = 0, t1 = 1;
      if (!moves || is_own_edge(input, query, id) || !is_outline(mesh, id.edge, query.p) ||
          length(cross(a, b)) == 0 || std::max(dot(query.n, a), dot(query.n, b)) <= 0 ||
          !cone.clip(a, b, t0, t1)) {
        continue;
      }
      ++count.wanted;
      EXPECT_TRUE(found[o][e]) << name << " object " << o << " edge " << e << " p " << query.p.x
                               << " " << query.p.y << " " << query.p.z;
    }
  }
}

TEST_P(Forests, ListOutlinesInCones) {
  Rng rng(24, 0, 0);
  Count count;
  for (const auto& [name, mesh] : meshes_of_all_kinds(rng)) {
    for (int i = 0; i < 6; ++i) {
      Vec3d rows[3];
      random_rotation(rng, rows);
      const double scale = random_scale(rng), shift = i % 2 == 0 ? 0 : 1e4 * rng.uniform();
      Mesh moved = transformed(mesh, rows, scale, random_direction(rng) * shift);
      set_test_tangents(moved);
      const Mesh other = transformed(mesh, rows, 0.1 * scale, {});
      const EdgeSamplerInput input{
          {build_edge_mesh(moved, i % 3 != 0), build_edge_mesh(other, true, ShapeId(1))}};
      const auto forest = EdgeForest::build(input, 1, GetParam());
      for (int k = 0; k < 60; ++k) {
        EdgeQuery query;
        query.p = random_point(input.objects[k % 2], scale, rng);
        query.n = random_direction(rng);
        if (k % 3 == 1) query.velocity.x[2] = 1;
        if (k % 3 == 2) query.turn.rate.y[0] = 1;
        if (k % 6 == 5) query.turn.axis = random_direction(rng);
        if (k % 5 == 0) query.face = {ShapeId(k % 2), FaceId(0)};
        const Vec3d to = random_point(input.objects[k % 2], scale, rng) - query.p;
        const Vec3d axis = length(to) > 0 ? normalize(to) : random_direction(rng);
        expect_outlines(input, *forest, query, random_cone(axis, rng), name, count);
      }
      if (HasFailure()) return;
    }
  }
  fmt::print("{} outlines, {} listed\n", count.wanted, count.listed);
  EXPECT_GT(count.wanted, 10000);
}

// More trees than are all looked at, some of which move.
TEST_P(Forests, ListOutlinesOfManyObjects) {
  Rng rng(25, 0, 0);
  Count count;
  for (int i = 0; i < 6; ++i) {
    const double scale = random_scale(rng), shift = i % 2 == 0 ? 0 : 1e4 * rng.uniform();
    EdgeSamplerInput input;
    for (uint32_t o = 0; o < 60; ++o) {
      Vec3d rows[3];
      random_rotation(rng, rows);
      const Vec3d at = random_direction(rng) * (3 * scale * rng.uniform());
      Mesh mesh = transformed(o % 2 == 0 ? cube_mesh() : grid_mesh(3), rows, 0.1 * scale,
                              at + Vec3d{shift, 0, 0});
      if (o % 5 == 0) set_test_tangents(mesh);
      input.objects.push_back(build_edge_mesh(mesh, o % 3 != 0, ShapeId(o)));
    }
    EXPECT_EQ(fault_of(build_forest(input, 1, GetParam()), input.objects), "");
    const auto forest = EdgeForest::build(input, 1, GetParam());
    for (int k = 0; k < 120; ++k) {
      expect_complete(input, *forest, random_point(input.objects[k % 60], scale, rng), "many");
      EdgeQuery query;
      query.p = random_point(input.objects[k % 60], scale, rng);
      query.n = random_direction(rng);
      if (k % 3 == 1) query.velocity.x[2] = 1;
      if (k % 3 == 2) query.turn.rate.y[0] = 1;
      const Vec3d to = random_point(input.objects[(7 * k) % 60], scale, rng) - query.p;
      const Vec3d axis = length(to) > 0 ? normalize(to) : random_direction(rng);
      expect_outlines(input, *forest, query, random_cone(axis, rng), "many", count);
    }
  }
  EXPECT_GT(count.wanted, 1000);
}

// Sharp edges are outlines only where one side is free.
TEST(Outlines, OfACube) {
  const EdgeMesh solid = build_edge_mesh(cube_mesh(), true),
                 sheet = build_edge_mesh(cube_mesh(), false);
  for (const EdgeMesh* mesh : {&solid, &sheet}) {
    const auto count = [&](const Vec3d& p) {
      int sum = 0;
      for (uint32_t e = 0; e < mesh->edges.size(); ++e) sum += is_outline(*mesh, EdgeId(e), p);
      return sum;
    };
    EXPECT_EQ(count({5, 0.2, 0.3}), 4);
    EXPECT_EQ(count({5, 6, 0.3}), 6);
    EXPECT_EQ(count({5, 6, 7}), 6);
    EXPECT_EQ(count({0.1, 0.2, 0.3}), 0);
  }
}

ForestConfig without(bool ForestConfig::*option) {
  ForestConfig config;
  config.*option = false;
  return config;
}
INSTANTIATE_TEST_SUITE_P(Variants, Forests,
                         testing::Values(ForestConfig{}, without(&ForestConfig::principal_axes),
                                         without(&ForestConfig::cull_concave),
                                         ForestConfig{.width = 2},
                                         without(&ForestConfig::soft_weights)));

TEST(Forest, DoesNotDependOnThreads) {
  Rng rng(22, 0, 0);
  Mesh mesh = with_smooth_normals(torus_mesh(80, 60));
  const EdgeSamplerInput input{{build_edge_mesh(mesh, true)}};
  const auto one = EdgeForest::build(input, 1), seven = EdgeForest::build(input, 7);
  for (int i = 0; i < 20; ++i) {
    const Vec3d p = random_direction(rng) * 3.0;
    EXPECT_EQ(silhouettes_of(*one, input, p), silhouettes_of(*seven, input, p));
  }
}

// Two objects of each kind.
TEST(Forest, IsValidForAllMeshes) {
  Rng rng(23, 0, 0);
  for (const auto& [name, mesh] : meshes_of_all_kinds(rng)) {
    Vec3d rows[3];
    random_rotation(rng, rows);
    const Mesh other = transformed(mesh, rows, 1e-3, {1e3, -1, 2});
    const EdgeSamplerInput input{
        {build_edge_mesh(mesh, true), build_edge_mesh(other, false, ShapeId(1))}};
    for (const EdgeMesh& object : input.objects) EXPECT_EQ(fault_of(object), "") << name;
    for (const uint32_t width : {2u, 5u, 8u}) {
      const Forest forest = build_forest(input, 2, ForestConfig{.width = width});
      EXPECT_EQ(fault_of(forest, input.objects), "") << name;
    }
  }
}

// Arrays that grow hold their elements twice: of large meshes, a fifth of a run's memory.
TEST(Forest, IsBuiltInTheRoomExpectedForIt) {
  const Mesh large = with_smooth_normals(torus_mesh(160, 120)), small = torus_mesh(4, 3);
  const EdgeSamplerInput input{{build_edge_mesh(large, true, ShapeId(0)),
                                build_edge_mesh(small, true, ShapeId(1)),
                                build_edge_mesh(large, false, ShapeId(2))}};
  const Forest forest = build_forest(input, 1, ForestConfig{});
  EXPECT_EQ(forest.edges.capacity(), expected_edge_nodes(input));
  EXPECT_EQ(forest.inner.capacity(), expected_edge_nodes(input) / 2);
}

// Each change breaks one invariant, which fault_of names.
TEST(Forest, CorruptedCopiesAreFound) {
  using Change = void (*)(Forest&);
  const std::pair<const char*, Change> changes[] = {
      {"there are slots for other objects", [](Forest& f) { f.slots.pop_back(); }},
      {"there are slots for other edges", [](Forest& f) { f.slots[0].pop_back(); }},
      {"a node is out of range", [](Forest& f) { f.roots[0] = 1000; }},
      {"a root has a parent", [](Forest& f) { f.head(f.roots[0]).parent = 0; }},
      {"no root leads to an inner node", [](Forest& f) { f.inner.push_back(f.inner[0]); }},
      {"no root leads to a node of edges", [](Forest& f) { f.edges.push_back(f.edges[0]); }},
      {"two ways lead to a node", [](Forest& f) { f.roots.push_back(f.roots[0]); }},
      {"a child has another parent", [](Forest& f) { f.head(f.inner[0].child[1]).parent = 0; }},
      {"a child is of another tree",
       [](Forest& f) { f.head(f.inner[0].child[1]).object = ShapeId(1); }},
      {"a height is not its children's", [](Forest& f) { ++f.inner[0].head.height; }},
      {"a node of edges is not at height 0", [](Forest& f) { f.edges[0].head.height = 1; }},
      {"a speed is negative", [](Forest& f) { f.inner[0].speed[0] = -1; }},
      {"a cover is negative", [](Forest& f) { f.inner[0].cover[2][0] = -1; }},
      {"a child's box is empty", [](Forest& f) { f.inner[0].high[0] = 0; }},
      {"a child's box does not hold its edges", [](Forest& f) { f.inner[0].low[0] += 200; }},
      {"a child's box is wider than its edges", [](Forest& f) { f.inner[0].high[1] += 3; }},
      {"the rows of a dual box are not of unit length",
       [](Forest& f) { f.inner[0].rows[0][1][0] *= 2; }},
      {"a lane without an edge has a length", [](Forest& f) { f.edges[0].edge[0] = kNoChild; }},
      {"an edge is in two lanes", [](Forest& f) { f.edges[0].edge[0] = f.edges[0].edge[1]; }},
      {"an end is not the mesh's", [](Forest& f) { f.edges[0].ends[0][1][0] += 1; }},
      {"an edge has no length", [](Forest& f) { f.edges[0].length[0] = 0; }},
      {"a slot does not lead to its edge",
       [](Forest& f) {
         f.edges[0].edge[0] = kNoChild;
         f.edges[0].length[0] = 0;
       }},
      {"an edge that may be a silhouette is in no node",
       [](Forest& f) {
         // Taken out without a trace, but for the edge itself.
         EdgeNode& node = f.edges[0];
         f.slots[node.head.object.index()][node.edge[0]] = kNoParent;
         node.edge[0] = kNoChild;
         node.length[0] = 0;
       }},
  };
  const EdgeMesh mesh = build_edge_mesh(with_smooth_normals(icosphere_mesh(2)), true);
  const EdgeSamplerInput input{{mesh, mesh}};
  const Forest whole = build_forest(input, 1, {});
  ASSERT_EQ(fault_of(whole, input.objects), "");
  for (const auto& [fault, change] : changes) {
    Forest copy = whole;
    change(copy);
    EXPECT_EQ(fault_of(copy, input.objects), fault);
  }
}

// A moving torus and a query that sees half of it.
EdgeSamplerInput moving_torus(double scale) {
  Mesh mesh = with_smooth_normals(torus_mesh(24, 12));
  set_test_tangents(mesh);
  for (Vec3f& x : mesh.positions) x = x * static_cast<float>(scale);
  return {{build_edge_mesh(mesh, true)}};
}

TEST(Forest, ProbabilitiesDoNotDependOnTheScale) {
  expect_same_at_all_scales<EdgeForest>(moving_torus, 0.5);
}

// Two floats hold a coordinate of p, scaled, to 2^-48 of it.
TEST(Forest, QueriesKeepThePointToTwiceAFloat) {
  Rng rng(25, 0, 0);
  const EdgeSamplerInput input = moving_torus(1);
  const Forest forest = build_forest(input, 1, {});
  for (int i = 0; i < 100; ++i) {
    EdgeQuery query;
    query.p = random_direction(rng) * random_scale(rng);
    const ForestQuery prepared(forest, nullptr, nullptr, query, input);
    for (int k = 0; k < 3; ++k) {
      const double x = query.p[k] * prepared.unit;
      EXPECT_LE(std::fabs(double{prepared.p[0][k]} + prepared.p[1][k] - x), 0x1p-48 * std::fabs(x));
    }
  }
}

// Sum over edges of w^2 / P, w their exact weights: the second moment of a draw.
double second_moment(const EdgeForest& forest, const EdgeSamplerInput& input,
                     const EdgeQuery& query, double& mean) {
  const LtcLobe lobe(query.lobe, query.n, query.wi);
  double moment = 0;
  mean = 0;
  for (const EdgeRef id : silhouettes_of(forest, input, query.p)) {
    const EdgeSegment segment = segment_of(input.object(id.object), id.edge, query);
    const Vec3d side = cross(segment.w_0, segment.w_1);
    double speed = 0;
    for (int i = 0; i < kLanes; ++i)
      for (const Vec3<Lanes>& v : {segment.v_0, segment.v_1})
        speed += 0.5 * std::fabs(dot(side, Vec3d{v.x[i], v.y[i], v.z[i]}));
    const double weight = LtcEdge(lobe, segment.w_0, segment.w_1).integral() * speed;
    if (weight == 0) continue;
    mean += weight;
    moment += weight * weight / forest.probability(query, id);
  }
  return moment;
}

// A narrow lobe that passes beside most of a mesh: nodes that are opened bring the second moment of
// a draw near that of the exact weights, the square of the mean.
TEST(Forest, OpensNodesForNarrowLobes) {
  Mesh torus = torus_mesh(48, 24);
  set_test_tangents(torus);
  const EdgeSamplerInput input{{build_edge_mesh(torus, true)}};
  const auto open = EdgeForest::build(input, 1),
             closed = EdgeForest::build(input, 1, {.most_open = 0});
  Rng rng(26, 0, 0);
  double with = 0, without = 0;
  RunningMean gain;
  constexpr int kQueries = 50;
  for (int i = 0; i < kQueries; ++i) {
    const EdgeMesh& mesh = input.objects[0];
    EdgeQuery query;
    query.n = random_direction(rng);
    query.p = query.n * -3.0;
    query.lobe.model = &ggx_lobe();
    query.lobe.alpha = 0.01;
    // Mirrored, the viewer's direction ends on the torus.
    const auto corner =
        static_cast<size_t>(rng.uniform() * static_cast<double>(mesh.positions.size()));
    const Vec3d to = normalize(mesh.positions[corner] - query.p);
    query.wi = query.n * (2 * dot(query.n, to)) - to;
    double mean = 0;
    const double moment = second_moment(*open, input, query, mean);
    if (mean == 0) continue;
    const double other = second_moment(*closed, input, query, mean);
    with += moment / (mean * mean) / kQueries;
    without += other / (mean * mean) / kQueries;
    gain.add(std::log(other / moment));
  }
  printf("second moments: %g with open nodes, %g without, 1 at best\n", with, without);
  // Of queries drawn at random, by five standard errors.
  EXPECT_GT(gain.z_score(0), 5);
}

Vec3<Lanes> random_velocity(Rng& rng) {
  Vec3<Lanes> v;
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < kLanes; ++i) v[k][i] = 2 * rng.uniform() - 1;
  return v;
}

// Of a torus that is moved, turned and stretched, differently in every lane.
EdgeSamplerInput linearly_moving_torus(Rng& rng) {
  Mesh mesh = with_smooth_normals(torus_mesh(24, 12));
  const Vec3<Lanes> columns[4] = {random_velocity(rng), random_velocity(rng), random_velocity(rng),
                                  random_velocity(rng)};
  for (const Vec3f& x : mesh.positions)
    mesh.position_tangents.push_back(columns[3] + columns[0] * double{x.x} +
                                     columns[1] * double{x.y} + columns[2] * double{x.z});
  EdgeSamplerInput input{{build_edge_mesh(mesh, true)}};
  input.lane_scale = {0.5, 1, 3, 0};
  return input;
}

EdgeQuery moving_query(bool follows, Rng& rng) {
  EdgeQuery query;
  query.p = random_direction(rng) * 3;
  query.n = query.wi = -normalize(query.p);
  query.velocity = random_velocity(rng);
  query.turn.rate = random_velocity(rng);
  if (follows) query.turn.axis = query.n;
  return query;
}

// What one map holds of a linear motion is all of it, against p and directions that turn or follow.
TEST(Forest, SeesHowEdgesMove) {
  Rng rng(27, 0, 0);
  for (int round = 0; round < 20; ++round) {
    const EdgeSamplerInput input = linearly_moving_torus(rng);
    const EdgeMesh& mesh = input.objects[0];
    const Forest forest = build_forest(input, 1, {});
    const EdgeQuery query = moving_query(round % 2 == 0, rng);
    const ForestQuery prepared(forest, nullptr, nullptr, query, input);
    const SeenMotion& seen = prepared.seen(forest.head(forest.roots[0]).motion);
    ASSERT_EQ(seen.count, 3);  // the scale of the last lane is 0
    for (uint32_t v = 0; v < mesh.positions.size(); ++v) {
      const Vec3<Lanes> u = relative_velocity(mesh, VertexId(v), query);
      const Vec3d w = (mesh.positions[v] - query.p) * prepared.unit;
      for (int i = 0; i < 3; ++i) {
        const SeenMotion::Lane& lane = seen.lanes[i];
        for (int k = 0; k < 3; ++k) {
          const Vec3d row{lane.linear[k][0], lane.linear[k][1], lane.linear[k][2]};
          EXPECT_NEAR(lane.at_p[k] + dot(row, w), u[k][i] * input.lane_scale[i] / lane.size,
                      0x1p-22);
        }
      }
    }
  }
}

// The share of draws that are outlines, of a flat-shaded ball.
double share_of_outlines(bool black_behind, float contrast) {
  Mesh mesh = icosphere_mesh(3);
  set_test_tangents(mesh);
  EdgeSamplerInput input{.objects = {build_edge_mesh(mesh, black_behind)},
                         .environment_luminance = 1};
  EdgeMesh& ball = input.objects[0];
  ball.fold_contrast = contrast;
  const auto forest = EdgeForest::build(input, 1, {});
  EdgeQuery query;
  query.p = {0.3, -0.2, 3};
  query.n = query.wi = -normalize(query.p);
  double outlines = 0, all = 0;
  for (uint32_t e = 0; e < ball.edges.size(); ++e) {
    const double probability = forest->probability(query, {ShapeId(0), EdgeId(e)});
    all += probability;
    if (is_outline(ball, EdgeId(e), query.p)) outlines += probability;
    // Folds stay possible.
    if (is_candidate(ball, EdgeId(e), query.p)) {
      EXPECT_GT(probability, 0);
    }
  }
  return outlines / all;
}

TEST(Forest, DrawsFoldsByHowMuchTheyDiffer) {
  for (const bool black_behind : {true, false}) {
    EXPECT_LT(share_of_outlines(black_behind, std::numeric_limits<float>::infinity()), 0.2);
    const double share = share_of_outlines(black_behind, 0.1f);
    EXPECT_GT(share, 0.5);
    EXPECT_LT(share, 0.95);
  }
}

// What no map holds is in the nodes of edges, whatever share it is.
TEST(Forest, KeepsMotionThatIsNotLinear) {
  Rng rng(28, 0, 0);
  for (const double bent : {0.0, 0.1, 10.0}) {
    EdgeSamplerInput input = linearly_moving_torus(rng);
    EdgeMesh& mesh = input.objects[0];
    for (size_t v = 0; v < mesh.tangents.size(); ++v)
      mesh.tangents.set(v, mesh.tangents[v] + random_velocity(rng) * bent);
    const Forest forest = build_forest(input, 1, {});
    const ObjectMotion& motion = forest.motions[forest.head(forest.roots[0]).motion];
    EXPECT_EQ(sum_of_speeds(motion.at_center) > 0, bent < 1);
    for (const EdgeNode& node : forest.edges)
      for (int lane = 0; lane < kWidth; ++lane) {
        if (node.edge[lane] == kNoChild) continue;
        double left = 0;
        for (const VertexId v : mesh.edge(node.edge_at(lane).edge).vertices)
          left += 0.5 * sum_of_speeds(scaled_velocity(mesh.tangent(v), input.lane_scale) -
                                      motion.velocity(mesh.position(v)));
        EXPECT_GT(node.speed[lane], 0);
        EXPECT_NEAR(node.speed[lane], left, 0x1p-24 * left + FLT_MIN);
      }
  }
}

// A torus that moves along itself: most silhouettes hardly move across the line of sight, and draws
// that know come nearer to those by exact weights.
TEST(Forest, WeighsMotionAcrossTheLineOfSight) {
  Mesh torus = with_smooth_normals(torus_mesh(48, 24));
  torus.position_tangents.assign(torus.positions.size(), {{1, 0, 0, 0}, {}, {}});
  const EdgeSamplerInput input{{build_edge_mesh(torus, true)}};
  const auto across = EdgeForest::build(input, 1),
             any = EdgeForest::build(input, 1, {.normal_speed = false});
  Rng rng(29, 0, 0);
  double with = 0, without = 0;
  RunningMean gain;
  constexpr int kQueries = 100;
  for (int i = 0; i < kQueries; ++i) {
    EdgeQuery query;
    query.p = random_direction(rng) * 3;
    query.n = query.wi = -normalize(query.p);
    double mean = 0;
    const double moment = second_moment(*across, input, query, mean);
    const double other = second_moment(*any, input, query, mean);
    with += moment / (mean * mean) / kQueries;
    without += other / (mean * mean) / kQueries;
    gain.add(std::log(other / moment));
  }
  printf("second moments: %g with motion across, %g with any, 1 at best\n", with, without);
  // Of queries drawn at random, by five standard errors.
  EXPECT_GT(gain.z_score(0), 5);
}

// Two flat rings, as mirror images; one is stretched across its plane, where it is a thousandth as
// thick as wide, and moves by at most 0.4 of the speed of the other. Weights count at least a tenth
// of the other's motion (kSlowest), so the first gets at most 4 draws for each of the other's; it
// would get hundreds if the stretch counted along the whole ring.
TEST(Forest, WeighsThinObjectsByWhatTheyMove) {
  constexpr float kThin = 1e-3f;
  EdgeSamplerInput input;
  for (const float side : {-1.0f, 1.0f}) {
    Mesh ring = torus_mesh(24, 12);
    for (Vec3f& x : ring.positions) x = {x.x + 2 * side, x.y, x.z * kThin};
    ring.position_tangents.assign(ring.positions.size(), {});
    for (size_t v = 0; v < ring.positions.size(); ++v)
      ring.position_tangents.set(
          v, {{}, {}, {side < 0 ? double{ring.positions[v].z} / kThin : 1, 0, 0, 0}});
    input.objects.push_back(build_edge_mesh(ring, true));
  }
  const auto forest = EdgeForest::build(input, 1);
  for (const double height : {0.5, 2.0, 6.0}) {
    EdgeQuery query;
    query.p = {0, -height, height};
    query.n = query.wi = -normalize(query.p);
    double shares[2] = {0, 0};
    for (uint32_t o = 0; o < 2; ++o)
      for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e)
        shares[o] += forest->probability(query, {ShapeId(o), EdgeId(e)});
    printf("thin ring %g, other %g\n", shares[0], shares[1]);
    EXPECT_GT(shares[0], 0);
    EXPECT_LT(shares[0], 4 * shares[1]);
  }
}

double lost_share(const EdgeForest& forest, const EdgeMesh& mesh, const EdgeQuery& query) {
  double sum = 0;
  for (uint32_t e = 0; e < mesh.edges.size(); ++e)
    sum += forest.probability(query, {ShapeId(0), EdgeId(e)});
  return 1 - sum;
}

// At a vertex all edges that end there pass for silhouettes, and none contributes. As many draws
// are lost there as at a point nearby on the same face.
TEST(Forest, LosesNoMoreDrawsAtAVertex) {
  const EdgeSamplerInput input = moving_torus(1);
  const Mesh torus = torus_mesh(24, 12);
  const EdgeMesh& mesh = input.objects[0];
  const auto forest = EdgeForest::build(input, 1);
  double at_vertices = 0, nearby = 0;
  int count = 0;
  for (uint32_t face = 0; face < torus.faces.size(); face += 3) {
    const FaceIndices& corners = torus.faces[face];
    EdgeQuery query;
    query.n = query.wi = mesh.planes[face].n;
    query.face = {ShapeId(0), FaceId(face)};
    query.p = mesh.positions[corners[0]];
    at_vertices += lost_share(*forest, mesh, query);
    query.p = query.p * 0.98 + (mesh.positions[corners[1]] + mesh.positions[corners[2]]) * 0.01;
    nearby += lost_share(*forest, mesh, query);
    ++count;
  }
  printf("lost at vertices %g, nearby %g\n", at_vertices / count, nearby / count);
  EXPECT_LE(at_vertices, nearby);
}

}  // namespace
}  // namespace limn
