// The paper's forest: what its nodes are fitted with, and that they lose no edge of E(p).
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "../support/hard_meshes.h"
#include "../support/meshes.h"
#include "../support/scaled_sampler.h"
#include "edgetree/bounds/normaliser.h"
#include "edgetree/forest/forest_build.h"
#include "edgetree/quadric/quadric_node.h"
#include "edgetree/quadric/quadric_query.h"
#include "edgetree/quadric/quadric_sampler.h"
#include "limn/edgetree/quadric_chart.h"

namespace limn {
namespace {

// Planes on all sides have no normaliser, whatever finds that out; others have one that separates
// them, if the linear program has.
TEST(Normaliser, IsWhereTheLinearProgramHasOne) {
  Rng rng(26, 0, 0);
  int none = 0, some = 0;
  for (int i = 0; i < 2000; ++i) {
    std::vector<Eigen::Vector4d> planes;
    const Vec3d lean = random_direction(rng) * (2 * rng.uniform());
    const double shift = 2 * rng.uniform() - 1, flat = i % 5 == 0 ? 1e-3 : 1;
    for (int k = 0; k < 1 + i % 40; ++k) {
      const Vec3d n = normalize(random_direction(rng) * flat + lean);
      planes.emplace_back(n.x, n.y, n.z, shift + flat * (2 * rng.uniform() - 1));
    }
    const auto least = [&](const Eigen::Vector4d& z) {
      double product = 1e300;
      for (const auto& q : planes) product = std::min(product, q.dot(z));
      return product;
    };
    const Eigen::Vector4d found = normaliser_of(planes), other = separating_direction(planes);
    EXPECT_TRUE(found.norm() == 0 || std::fabs(found.norm() - 1) < 1e-12);
    EXPECT_EQ(found.norm() > 0, other.norm() > 0 && least(other / other.norm()) >= 0x1.0p-20) << i;
    if (found.norm() > 0) {
      EXPECT_GE(least(found), 0x1.0p-20);
    }
    ++(found.norm() > 0 ? some : none);
  }
  EXPECT_GT(some, 200);  // about 1700 and 300: the order of draws differs between compilers
  EXPECT_GT(none, 200);
}

// A polynomial and a plane in one lane; the others hold copies.
struct Case {
  double k[9], g[4];

  double f(const Vec3d& u) const {
    double sum = 0;
    for (int i = 0; i < 3; ++i)
      sum += u[i] * (k[i] + k[3 + i] * u[i]) + k[6 + i] * u[(i + 1) % 3] * u[(i + 2) % 3];
    return sum;
  }
  bool accepts(double low, double high, double error) const {
    QuadricPairs pairs;
    QueryPlanes planes;
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      for (int i = 0; i < 3; ++i) {
        pairs.linear[i][lane] = static_cast<float>(k[i]);
        pairs.square[i][lane] = static_cast<float>(k[3 + i]);
        pairs.product[i][lane] = static_cast<float>(k[6 + i]);
      }
      pairs.low[lane] = static_cast<float>(low);
      pairs.high[lane] = static_cast<float>(high);
      for (int i = 0; i < 4; ++i) planes.g[i][lane] = g[i];
    }
    planes.error = error;
    const Longs met = meet_box(planes) & meet_pair(pairs, planes);
    EXPECT_TRUE(met[0] == met[1] && met[0] == met[2] && met[0] == met[3]);
    return met[0] != 0;
  }
};

// Some coefficients are zero or tiny, so that planes are parallel to axes and quadrics to planes.
Case random_case(Rng& rng) {
  const auto value = [&] {
    const double kind = rng.uniform(), v = 2 * rng.uniform() - 1;
    return kind < 0.15 ? 0 : kind < 0.3 ? v * std::exp(-40 * rng.uniform()) : v;
  };
  Case c;
  double sum = 0;
  for (double& k : c.k) sum += std::fabs(k = value());
  for (double& k : c.k) k = sum > 0 ? static_cast<float>(k / sum * (1 - 1e-6)) : 0;
  for (double& g : c.g) g = value();
  return c;
}

// Of f over the polygon, by many of its points: each of a fine grid on the two other axes that the
// plane lifts into the box, and the ends of each grid line.
struct Sampled {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  std::vector<double> values;
};
Sampled sampled_range(const Case& c, int steps) {
  Sampled range;
  int d = 0;
  for (int i = 1; i < 3; ++i)
    if (std::fabs(c.g[i + 1]) > std::fabs(c.g[d + 1])) d = i;
  const int a = (d + 1) % 3, b = (d + 2) % 3;
  const auto visit = [&](double s, double t) {
    Vec3d u;
    u[a] = s;
    u[b] = t;
    u[d] = -(c.g[0] + c.g[a + 1] * s + c.g[b + 1] * t) / c.g[d + 1];
    if (!(std::fabs(u[d]) <= 1)) return;
    range.values.push_back(c.f(u));
    range.low = std::min(range.low, range.values.back());
    range.high = std::max(range.high, range.values.back());
  };
  for (int i = 0; i <= steps; ++i)
    for (int k = 0; k <= steps; ++k) visit(2.0 * i / steps - 1, 2.0 * k / steps - 1);
  return range;
}

TEST(QuadricPair, FindsTheRangeOverThePolygon) {
  Rng rng(41, 0, 0);
  constexpr int kSteps = 60;
  int accepted = 0, rejected = 0, tight = 0;
  for (int i = 0; i < 3000; ++i) {
    const Case c = random_case(rng);
    const Sampled range = sampled_range(c, kSteps);
    const double error = 1e-40;
    if (range.values.empty()) continue;
    // Slabs of no width through values that are taken.
    for (int k = 0; k < 10; ++k) {
      const double value = range.values[static_cast<size_t>(rng.uniform() * range.values.size())];
      EXPECT_TRUE(c.accepts(value - 1e-7, value + 1e-7, error)) << i;
    }
    EXPECT_TRUE(c.accepts(range.low - 1e-7, range.low + 1e-7, error)) << i;
    EXPECT_TRUE(c.accepts(range.high - 1e-7, range.high + 1e-7, error)) << i;
    // Slabs beside the range, as far as a grid may miss: a cell at the polygon's motion_group,
    // where the third axis is as steep as the others, times the slope (moduli add up to 1).
    const double beyond = 3 * 2.0 / kSteps;
    EXPECT_FALSE(c.accepts(range.high + beyond, range.high + 1, error)) << i;
    EXPECT_FALSE(c.accepts(range.low - 1, range.low - beyond, error)) << i;
    accepted += 12;
    rejected += 2;
    tight += range.high - range.low < 0.5;
  }
  EXPECT_GT(accepted, 10000);
  EXPECT_GT(rejected, 1000);
  EXPECT_GT(tight, 100);
}

TEST(QuadricPair, WithoutAPolynomialNothingIsRejected) {
  Case c{};
  c.g[1] = 1;
  const double infinite = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(c.accepts(-infinite, infinite, 1e-9));
  for (double& g : c.g) g = 0;
  EXPECT_TRUE(c.accepts(1, 2, 1e-9));  // a plane that is none
  c.g[1] = std::numeric_limits<double>::quiet_NaN();
  QueryPlanes planes;
  for (Doubles& g : planes.g) g = splat4(c.g[1]);
  planes.error = 1e-9;
  EXPECT_NE(meet_pair(QuadricPairs{}, planes)[0], 0);
}

Wedge random_wedge(const NodeFrame& frame, Rng& rng) {
  Wedge wedge;
  for (Plane& plane : wedge.planes) {
    plane.n = random_direction(rng);
    const Vec3d x = frame.center + random_direction(rng) * (rng.uniform() / frame.inverse_radius);
    plane.offset = -dot(plane.n, x);
  }
  return wedge;
}

// What a parent sums up from its children, whatever their frames, fits as its own planes do.
TEST(PlaneMoments, OfChildrenAddUp) {
  Rng rng(42, 0, 0);
  for (int i = 0; i < 100; ++i) {
    const NodeFrame parent{random_direction(rng) * 3.0, 0.5};
    PlaneMoments sum;
    std::vector<Wedge> all;
    for (int child = 0; child < 3; ++child) {
      const NodeFrame frame{parent.center + random_direction(rng), 2 + 10 * rng.uniform()};
      std::vector<Wedge> wedges(6);
      for (Wedge& wedge : wedges) all.push_back(wedge = random_wedge(frame, rng));
      sum.add(moments_of(wedges, frame), frame, parent);
    }
    const Eigen::Matrix4d a = sum.best_quadric(), b = moments_of(all, parent).best_quadric();
    const double same = std::fabs(a.cwiseProduct(b).sum()) / (a.norm() * b.norm());
    EXPECT_NEAR(same, 1, 1e-6) << i;
  }
}

// The planes of an ellipsoid satisfy q . Q q = 0 for Q = diag(a^2, b^2, c^2, -1), with any center.
TEST(PlaneMoments, FindAnEllipsoid) {
  Rng rng(43, 0, 0);
  for (int i = 0; i < 100; ++i) {
    const Vec3d axes{0.2 + rng.uniform(), 0.2 + rng.uniform(), 0.2 + rng.uniform()};
    const Vec3d center = random_direction(rng) * 0.5;
    PlaneMoments moments;
    std::vector<Eigen::Vector4d> planes;
    const Vec3d lean = random_direction(rng) * 1.2;
    for (int k = 0; k < 60; ++k) {
      const Vec3d n = normalize(random_direction(rng) + lean);
      const double support = length(Vec3d{n.x * axes.x, n.y * axes.y, n.z * axes.z});
      planes.emplace_back(n.x, n.y, n.z, -(dot(n, center) + support));
      moments.add(planes.back());
    }
    const Eigen::Matrix4d q = moments.best_quadric();
    for (const Eigen::Vector4d& plane : planes)
      EXPECT_LT(std::fabs(plane.dot(q * plane)), 1e-5 * q.norm()) << i;
  }
}

// The coordinates u of a plane in a box of rows: q = s (row_0 + sum of u_k row_(k+1)).
Eigen::Vector3d coordinates_of(const double (&rows)[4][4], const Eigen::Vector4d& q) {
  Eigen::Matrix4d columns;
  for (int i = 0; i < 4; ++i) columns.col(i) = Eigen::Vector4d::Map(rows[i]);
  const Eigen::Vector4d all = columns.partialPivLu().solve(q);
  return all.tail<3>() / all[0];
}

// Planes of each set reach all six sides of its boxes, and both of its quadrics: a bound that were
// wider by a hundredth would fail.
TEST(Fits, AreTight) {
  Rng rng(47, 0, 0);
  for (int i = 0; i < 200; ++i) {
    const NodeFrame frame{random_direction(rng), 0.5};
    const Vec3d lean = random_direction(rng) * 1.5;
    std::vector<Wedge> wedges(8);
    for (Wedge& wedge : wedges) {
      wedge = random_wedge(frame, rng);
      for (Plane& plane : wedge.planes) {
        const Vec3d n = normalize(plane.n + lean);
        plane.offset += dot(plane.n - n, frame.center);
        plane.n = n;
      }
    }
    const PlaneMoments moments = moments_of(wedges, frame);
    const QuadricFit pair = fit_quadrics(wedges, frame, &moments, frame);
    const DualFit box = fit_dual(wedges, frame, {});
    double low = 1e300, high = -low;
    Eigen::Vector3d lower[2], upper[2];
    for (int k = 0; k < 2; ++k) lower[k].setConstant(1e300), upper[k].setConstant(-1e300);
    for (const Wedge& wedge : wedges) {
      Eigen::Vector3d ends[2];
      for (int e = 0; e < 2; ++e) {
        const Eigen::Vector4d q = dual_point(wedge.planes[e], frame);
        ends[e] = coordinates_of(pair.rows, q);
        const Eigen::Vector3d other = coordinates_of(box.rows, q);
        lower[0] = lower[0].cwiseMin(ends[e]), upper[0] = upper[0].cwiseMax(ends[e]);
        lower[1] = lower[1].cwiseMin(other), upper[1] = upper[1].cwiseMax(other);
      }
      constexpr int kSteps = 100;
      for (int step = 0; step <= kSteps; ++step) {
        const Eigen::Vector3d u = ends[0] + (ends[1] - ends[0]) * (step / double{kSteps});
        const auto& c = pair.pair.coefficients;
        double f = 0;
        for (int k = 0; k < 3; ++k)
          f += u[k] * (c[k] + c[3 + k] * u[k]) + c[6 + k] * u[(k + 1) % 3] * u[(k + 2) % 3];
        low = std::min(low, f), high = std::max(high, f);
      }
    }
    for (int k = 0; k < 2; ++k) {
      EXPECT_LT((lower[k].array() + 1).abs().maxCoeff(), 1e-9) << i;
      EXPECT_LT((upper[k].array() - 1).abs().maxCoeff(), 1e-9) << i;
    }
    const double slack = 0.01 * (high - low);
    EXPECT_NEAR(pair.pair.low, low, slack) << i;
    EXPECT_NEAR(pair.pair.high, high, slack) << i;
  }
}

// The bounds of all edges below a child.
Bounds edges_below(const EdgeSamplerInput& input, const QuadricForest& forest, NodeId id) {
  Bounds bounds;
  for (int lane = 0; lane < kQuadricWidth; ++lane) {
    const int32_t child = forest.lanes(id)[lane];
    if (child == kNoChild) continue;
    if (id >= 0) {
      const Bounds below = edges_below(input, forest, child);
      bounds.extend(below.lower);
      bounds.extend(below.upper);
      continue;
    }
    const EdgeMesh& mesh = input.object(forest.leaves[~id].object);
    for (const VertexId end : mesh.edge(EdgeId(static_cast<uint32_t>(child))).vertices) {
      bounds.extend(mesh.position(end));
    }
  }
  return bounds;
}

TEST(Quadric, BoxesOfEdgesAreTight) {
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(40, 20)), true)}};
  const QuadricForest forest = build_quadric_forest(input, 1, {});
  for (const QuadricNode& node : forest.nodes) {
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      if (node.child[lane] == kNoChild) continue;
      const Bounds below = edges_below(input, forest, node.child[lane]);
      for (int k = 0; k < 3; ++k) {
        const double half = 0.5 * (below.upper[k] - below.lower[k]) * node.inverse_radius;
        EXPECT_NEAR(node.half[k][lane], half, 0x1p-18);
      }
    }
  }
}

// All edges that descents can reach, by the trees alone, against the exact test of every edge.
// Returns the number of pairs of point and edge.
uint64_t expect_complete(const EdgeSamplerInput& input, const QuadricForest& forest, const Vec3d& p,
                         const std::string& name) {
  std::vector<std::vector<bool>> found;
  for (const EdgeMesh& mesh : input.objects) found.emplace_back(mesh.edges.size(), false);
  const QuadricPoint point(forest, p);
  std::vector<NodeId> stack = forest.roots;
  while (!stack.empty()) {
    const NodeId id = stack.back();
    stack.pop_back();
    if (id < 0) {
      const QuadricLeaf& leaf = forest.leaves[~id];
      for (const int32_t edge : leaf.edge)
        if (edge != kNoChild) found[leaf.object.index()][edge] = true;
      continue;
    }
    const Longs alive = may_hold_candidates(forest, id, point);
    for (int lane = 0; lane < kQuadricWidth; ++lane)
      if (alive[lane]) stack.push_back(forest.nodes[id].child[lane]);
  }
  uint64_t pairs = 0;
  for (uint32_t o = 0; o < input.objects.size(); ++o)
    for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e, ++pairs)
      EXPECT_TRUE(found[o][e] || !is_candidate(input.objects[o], EdgeId(e), p))
          << name << " object " << o << " edge " << e << " p " << p.x << " " << p.y << " " << p.z;
  return pairs;
}

// points: of each of six scenes per mesh.
uint64_t expect_no_edge_lost(uint64_t seed, int points) {
  Rng rng(seed, 0, 0);
  uint64_t pairs = 0;
  for (const auto& [name, mesh] : meshes_of_all_kinds(rng)) {
    for (int i = 0; i < 6; ++i) {
      const auto [input, scale] = placed_twice(mesh, i, rng);
      const QuadricForest forest =
          build_quadric_forest(input, 1, QuadricConfig{.cull_concave = i % 2 == 0});
      for (int k = 0; k < points; ++k)
        pairs +=
            expect_complete(input, forest, random_point(input.objects[k % 2], scale, rng), name);
      if (testing::Test::HasFailure()) return pairs;
    }
  }
  return pairs;
}

TEST(Quadric, LosesNoEdge) { EXPECT_GT(expect_no_edge_lost(44, 40), 1000000u); }

// Half a minute: --gtest_also_run_disabled_tests.
TEST(Quadric, DISABLED_LosesNoEdgeOfManyPairs) {
  uint64_t pairs = 0;
  for (uint64_t seed = 45; pairs < 300000000 && !HasFailure(); ++seed)
    pairs += expect_no_edge_lost(seed, 400);
  RecordProperty("pairs", std::to_string(pairs));
  printf("%llu pairs\n", static_cast<unsigned long long>(pairs));
}

TEST(Quadric, DoesNotDependOnThreads) {
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(80, 60)), true)}};
  const QuadricForest one = build_quadric_forest(input, 1, {}),
                      seven = build_quadric_forest(input, 7, {});
  ASSERT_EQ(one.nodes.size(), seven.nodes.size());
  for (size_t i = 0; i < one.nodes.size(); ++i) {
    for (int lane = 0; lane < kQuadricWidth; ++lane) {
      EXPECT_EQ(one.nodes[i].child[lane], seven.nodes[i].child[lane]);
      EXPECT_EQ(one.nodes[i].weight[lane], seven.nodes[i].weight[lane]);
      EXPECT_EQ(one.nodes[i].rows[3][1][lane], seven.nodes[i].rows[3][1][lane]);
      EXPECT_EQ(one.pairs[i].high[lane], seven.pairs[i].high[lane]);
      EXPECT_EQ(one.pairs[i].square[0][lane], seven.pairs[i].square[0][lane]);
    }
  }
}

// The pair rejects some of what the box keeps, and nothing else is changed by it.
TEST(Quadric, PairsRejectWhatBoxesKeep) {
  Rng rng(46, 0, 0);
  const EdgeSamplerInput input{{build_edge_mesh(with_smooth_normals(torus_mesh(80, 60)), true)}};
  const QuadricForest with = build_quadric_forest(input, 1, {}),
                      without = build_quadric_forest(input, 1, QuadricConfig{.quadrics = false});
  ASSERT_EQ(with.nodes.size(), without.nodes.size());
  int boxes = 0, pairs = 0;
  for (int i = 0; i < 20; ++i) {
    const Vec3d p = random_direction(rng) * 2.5;
    for (size_t node = 0; node < with.nodes.size(); ++node) {
      const auto id = static_cast<NodeId>(node);
      const Longs a = may_hold_candidates(with, id, {with, p});
      const Longs b = may_hold_candidates(without, id, {without, p});
      for (int lane = 0; lane < kQuadricWidth; ++lane) {
        EXPECT_TRUE(b[lane] || !a[lane]);
        boxes += b[lane] != 0;
        pairs += a[lane] != 0;
      }
    }
  }
  EXPECT_LT(pairs, 0.96 * boxes);
}

// What is drawn of a node are its own planes: they lie in its box and between its quadrics. The
// rows of a box are floats, whose rounding is not small against a box of few edges.
TEST(QuadricChart, HoldsThePlanesOfItsNode) {
  EdgeSamplerInput input;
  input.objects.push_back(build_edge_mesh(torus_mesh(40, 20), true));
  const auto sampler = QuadricSampler::build(input, 1, QuadricConfig{});
  const auto tree = sampler->rejection_tree();
  const auto& charted = dynamic_cast<const ChartedTree&>(*tree);
  constexpr double kRounding = 0x1p-10;
  int planes = 0;
  for (uint32_t node = 0; node < tree->nodes().size(); ++node) {
    const auto chart = charted.chart(node);
    if (!chart) continue;
    for (const auto& wedge : chart->edges) {
      for (const Vec3d& u : wedge) {
        double f = 0;
        for (int k = 0; k < 3; ++k) {
          EXPECT_LE(std::fabs(u[k]), 1 + kRounding);
          f += u[k] * (chart->linear[k] + chart->square[k] * u[k]) +
               chart->product[k] * u[(k + 1) % 3] * u[(k + 2) % 3];
        }
        EXPECT_GE(f, chart->low - kRounding);
        EXPECT_LE(f, chart->high + kRounding);
        ++planes;
      }
    }
  }
  EXPECT_GT(planes, 1000);
}

TEST(Quadric, ProbabilitiesDoNotDependOnTheScale) {
  const auto input_at = [](double scale) {
    Mesh mesh = with_smooth_normals(torus_mesh(24, 12));
    for (Vec3f& x : mesh.positions) x = x * static_cast<float>(scale);
    EdgeSamplerInput input{.objects = {build_edge_mesh(mesh, true)}, .environment_luminance = 1};
    input.lights.push_back(
        {{{-scale, -scale, 4 * scale}, {scale, 2 * scale, 4 * scale}, {scale, -scale, 4 * scale}},
         2});
    return input;
  };
  expect_same_at_all_scales<QuadricSampler>(input_at, 0.3);
}

// A square light before a box: the part of the box's solid angle that it fills.
TEST(PolygonLights, FillsOfABoxAreKnown) {
  const double s = 1.0;
  const auto square = [&](double x0, double x1) {
    return std::vector<LightTriangle>{{{{x0, s, 2}, {x1, s, 2}, {x1, -s, 2}}, 3},
                                      {{{x0, s, 2}, {x1, -s, 2}, {x0, -s, 2}}, 3}};
  };
  const LtcLobe lobe({}, {0, 0, 1}, {0, 0, 1});
  const auto mean = [&](double x0, double x1, const Vec3d& center, const Vec3d& half) {
    return PolygonLights(square(x0, x1), 0).mean_over_box(lobe, {}, center, half, 1);
  };
  // In front of all of it: about the cosine over pi, times the luminance; half of it, where the
  // light ends in the middle; nothing beside it; and nothing from its back.
  const Vec3d center{0, 0, 1}, half{0.01, 0.01, 0.01};
  EXPECT_NEAR(mean(-1, 1, center, half), 3 / kPi, 1e-3);
  EXPECT_NEAR(mean(-1, 0, center, half), 1.5 / kPi, 1e-3);
  EXPECT_EQ(mean(-1, 1, {2, 0, 1}, half), 0);
  EXPECT_EQ(mean(1, -1, center, half), 0);
  // From inside the box, the whole light over the sphere: its form factor, known for a square of
  // half width s at distance d from a point below its center.
  const double d = 2, a = s / std::hypot(s, d);
  const double factor = 4 * 2 * a * std::atan(a) / (2 * kPi);
  EXPECT_NEAR(mean(-1, 1, {}, {1, 1, 1}), 3 * factor / (4 * kPi), 1e-12);
}

}  // namespace
}  // namespace limn
