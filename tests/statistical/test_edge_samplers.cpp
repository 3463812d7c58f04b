// Every edge sampler: what it draws against the probabilities it states, and the bounds behind
// them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support/chi_square.h"
#include "../support/meshes.h"
#include "../support/running_mean.h"
#include "../support/test_names.h"
#include "limn/core/error.h"
#include "limn/edgetree/contribution_bound.h"
#include "limn/edgetree/edge_sampler_types.h"

namespace limn {
namespace {

// Fixed seeds: a p-value below this, or a z-score beyond +-5 (chance 6e-7), is an error, not luck.
constexpr double kSignificance = 1e-6;

bool is_diffuse(const LobeSummary& lobe) { return lobe.model == &kHemisphere; }
bool is_ggx(const LobeSummary& lobe) { return lobe.model == &ggx_lobe(); }
bool is_beckmann(const LobeSummary& lobe) { return lobe.model == &beckmann_lobe(); }

// A lobe that the library does not know: a cosine's power about the mirror direction, whose width
// it tells and which it takes for a GGX lobe.
class PhongLobe final : public LobeModel {
 public:
  static double power(const LobeSummary& lobe) { return 2 / (lobe.alpha * lobe.alpha); }
  Vec3d axis(const Vec3d& n, const Vec3d& wi) const override { return n * (2 * dot(n, wi)) - wi; }
  double width(const LobeSummary& lobe) const override { return std::min(1.0, lobe.alpha); }
  double bound(const LobeSummary& lobe, double, double cos_o, double cos_axis) const override {
    if (cos_axis <= 0) return 0;
    return lobe.albedo * (power(lobe) + 2) / (2 * kPi) * std::pow(cos_axis, power(lobe)) * cos_o;
  }
  std::optional<LtcRow> ltc(const LobeSummary& lobe) const override {
    return LtcRow{LtcRow::Table::kGgx, lobe.alpha};
  }
};
constexpr PhongLobe kPhong;
bool is_phong(const LobeSummary& lobe) { return lobe.model == &kPhong; }

// What the bounds are made for: Lambert, microfacets with Smith's separable G and F = albedo, and
// the lobe above.
double scattering(const EdgeQuery& q, const Vec3d& wo) {
  const double cos_o = dot(q.n, wo), cos_i = dot(q.n, q.wi), a = q.lobe.alpha;
  if (cos_o <= 0) return 0;
  if (is_phong(q.lobe)) return kPhong.bound(q.lobe, cos_i, cos_o, dot(kPhong.axis(q.n, q.wi), wo));
  if (is_diffuse(q.lobe)) return q.lobe.albedo / kPi * cos_o;
  const double c = dot(q.n, normalize(q.wi + wo)), tan2 = (1 - c * c) / (c * c);
  const auto masking = [&](double cosine) {
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const double tangent = sine / cosine, x = 1 / (a * tangent);
    if (is_ggx(q.lobe)) return 2 / (1 + std::sqrt(1 + a * a * tangent * tangent));
    return 1 / (1 + 0.5 * (std::erf(x) - 1) + std::exp(-x * x) / (2 * x * std::sqrt(kPi)));
  };
  const double d = is_ggx(q.lobe) ? a * a / (kPi * std::pow(c * c * (a * a - 1) + 1, 2))
                                  : std::exp(-tan2 / (a * a)) / (kPi * a * a * std::pow(c, 4));
  return q.lobe.albedo * d * masking(cos_o) * masking(cos_i) / (4 * cos_i);
}

// f_s times the sum over lanes of |J|.
double integrand(const EdgeQuery& q, const EdgeSegment& s, double t) {
  const Vec3d w = s.w_0 * (1 - t) + s.w_1 * t, c = cross(s.w_0, s.w_1);
  double sum = 0;
  for (int i = 0; i < kLanes; ++i) {
    const auto v = [&](int k) { return s.v_0[k][i] * (1 - t) + s.v_1[k][i] * t; };
    sum += std::fabs(v(0) * c.x + v(1) * c.y + v(2) * c.z);
  }
  return scattering(q, normalize(w)) * sum / std::pow(length(w), 3);
}

// Midpoint rule: stays below the exact integral's bound up to its own error, which `cells` halves.
double integral(const EdgeQuery& q, const EdgeSegment& s, int cells) {
  double sum = 0;
  for (int i = 0; i < cells; ++i) sum += integrand(q, s, (i + 0.5) / cells);
  return sum / cells;
}

LobeSummary random_lobe(Rng& rng) {
  const double u = rng.uniform();
  const LobeModel& kind = u < 0.25   ? kHemisphere
                          : u < 0.5  ? ggx_lobe()
                          : u < 0.75 ? beckmann_lobe()
                                     : static_cast<const LobeModel&>(kPhong);
  const double alpha = std::exp(std::log(1e-3) * rng.uniform());
  return {kind, alpha, 0.2 + 0.8 * rng.uniform()};
}

// A point around the origin at a distance of 1.1 to 4, looking about.
EdgeQuery random_query(Rng& rng) {
  EdgeQuery q;
  q.p = random_direction(rng) * (1.1 + 3 * rng.uniform());
  q.n = normalize(random_direction(rng) * 0.8 - normalize(q.p));
  do q.wi = random_direction(rng);
  while (dot(q.n, q.wi) <= 0);
  q.lobe = random_lobe(rng);
  q.velocity.y = Lanes{0, 0, 0, rng.uniform()};
  return q;
}

// Two moving objects side by side; of the second folds differ less.
EdgeSamplerInput test_input(const Mesh& mesh) {
  Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Mesh first = mesh, second = transformed(mesh, identity, 0.5, {1.2, 0.1, -0.4});
  set_test_tangents(first);
  set_test_tangents(second);
  EdgeSamplerInput input{
      .objects = {build_edge_mesh(first, true), build_edge_mesh(second, true, ShapeId(1))},
      .environment_luminance = 1};
  input.objects[1].fold_contrast = 0.3f;
  return input;
}

// Small objects around the origin, a fifth of which move, over a large one.
EdgeSamplerInput many_objects() {
  Rng rng(29, 0, 0);
  EdgeSamplerInput input;
  input.environment_luminance = 1;
  for (uint32_t o = 0; o < 81; ++o) {
    Vec3d rows[3];
    random_rotation(rng, rows);
    const Vec3d at = o == 0 ? Vec3d{0, 0, -2} : random_direction(rng) * (2 * rng.uniform());
    Mesh mesh =
        transformed(o % 2 == 0 ? tetrahedron_mesh() : cube_mesh(), rows, o == 0 ? 2 : 0.05, at);
    if (o % 5 == 4) set_test_tangents(mesh);
    input.objects.push_back(build_edge_mesh(mesh, o % 3 != 0, ShapeId(o)));
  }
  return input;
}

struct NamedInput {
  std::string name;
  EdgeSamplerInput input;
};
std::vector<NamedInput> test_inputs() {
  std::vector<NamedInput> inputs;
  for (const auto& [name, mesh] : test_meshes()) inputs.push_back({name, test_input(mesh)});
  inputs.push_back({"many objects", many_objects()});
  return inputs;
}
// Of six queries the last is at rest.
EdgeQuery random_query(int i, Rng& rng) {
  EdgeQuery q = random_query(rng);
  if (i == 5) q.velocity = {};
  return q;
}

template <class F>
void for_every_edge(const EdgeSamplerInput& input, F f) {
  for (uint32_t o = 0; o < input.objects.size(); ++o)
    for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e) f(EdgeRef{ShapeId(o), EdgeId(e)});
}

TEST(LobeBound, BoundsTheScatteringFunctionOverArcs) {
  Rng rng(11, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    const EdgeQuery q = random_query(rng);
    const LobeBound lobe(q.n, q.wi, q.lobe);
    // Half of the arcs start near the mirror direction, where the lobe is steep.
    const double spread = std::exp(-8 * rng.uniform());
    const Vec3d a = rng.uniform() < 0.5 ? random_direction(rng)
                                        : normalize(lobe.axis() + random_direction(rng) * spread);
    const Vec3d b = normalize(a + random_direction(rng) * spread);
    const double bound = lobe.over_arc(a, b);
    for (int k = 0; k < 20; ++k) {
      const double s = rng.uniform();
      const Vec3d u = normalize(a * (1 - s) + b * s);
      // Rounding: the cosines that enter D are right to 1e-16, and D(alpha) turns that into a
      // relative error of 1e-16 / alpha^2.
      const double rounding = 1e-14 / (q.lobe.alpha * q.lobe.alpha);
      EXPECT_LE(scattering(q, u), bound * (1 + rounding)) << i;
    }
  }
}

// Towards a viewer on the normal every half vector lies in the plane of incidence, and smooth lobes
// mask nothing: the bounds of short arcs give nothing away.
TEST(LobeBound, IsTightOnTheNormal) {
  Rng rng(25, 0, 0);
  int count[2] = {0, 0};
  for (int i = 0; i < 400; ++i) {
    EdgeQuery q = random_query(rng);
    q.wi = q.n;
    q.lobe.alpha = std::min(q.lobe.alpha, 0.1);
    const Vec3d a = normalize(q.n + random_direction(rng) * (2 * q.lobe.alpha));
    const Vec3d b = normalize(a + random_direction(rng) * (1e-3 * q.lobe.alpha));
    const double least = std::min(scattering(q, a), scattering(q, b));
    EXPECT_LE(LobeBound(q.n, q.wi, q.lobe).over_arc(a, b), 1.05 * least) << i;
    count[0] += is_ggx(q.lobe), count[1] += is_beckmann(q.lobe);
  }
  EXPECT_GT(std::min(count[0], count[1]), 50);
}

TEST(EdgeBound, BoundsTheIntegralAndIsTightForShortEdges) {
  Rng rng(12, 0, 0);
  for (int i = 0; i < 3000; ++i) {
    EdgeQuery q = random_query(rng);
    q.lobe.alpha = std::max(q.lobe.alpha, 0.02);  // so that the midpoint rule resolves the lobe
    EdgeSegment s;
    s.w_0 = random_direction(rng);
    const double size = std::exp(1 - 9 * rng.uniform());
    s.w_1 = s.w_0 + random_direction(rng) * size;
    for (int k = 0; k < 3; ++k)
      for (int l = 0; l < kLanes; ++l)
        s.v_0[k][l] = s.v_1[k][l] = l == 3 ? 0 : 2 * rng.uniform() - 1;
    const EdgeBound bound(LobeBound(q.n, q.wi, q.lobe), s);
    const double fine = integral(q, s, 2000), coarse = integral(q, s, 1000);
    EXPECT_LE(fine, bound.total() + std::fabs(fine - coarse)) << i;
    if (is_diffuse(q.lobe) && size < 0.01 && dot(q.n, s.w_0) > 0.1) {
      EXPECT_GT(fine, 0.85 * bound.total()) << i;
    }
  }
}

TEST(EdgeBound, ScaleOfTheSceneDropsOut) {
  Rng rng(13, 0, 0);
  for (int i = 0; i < 200; ++i) {
    const EdgeQuery q = random_query(rng);
    EdgeSegment s;
    s.w_0 = random_direction(rng);
    s.w_1 = random_direction(rng);
    s.v_0.x = s.v_1.x = Lanes{1, 0, 0, 0};
    s.v_1.y = Lanes{0, 1, 0, 0};
    const LobeBound lobe(q.n, q.wi, q.lobe);
    const EdgeBound unit(lobe, s);
    for (double scale : {0x1.0p-10, 0x1.0p13}) {  // J is of degree 0 if v scales along
      EdgeSegment scaled{s.w_0 * scale, s.w_1 * scale, s.v_0, s.v_1};
      const EdgeBound other(lobe, scaled);
      EXPECT_DOUBLE_EQ(other.total() * scale, unit.total());
      if (unit.total() > 0) {
        EXPECT_DOUBLE_EQ(other.pdf_t(0.4), unit.pdf_t(0.4));
      }
    }
  }
}

TEST(EdgeBound, StillEdgesAndEdgesBelowTheHorizonCount0) {
  EdgeQuery q;
  q.n = q.wi = {0, 0, 1};
  q.lobe.albedo = 1;
  const LobeBound lobe(q.n, q.wi, q.lobe);
  EdgeSegment s{{1, 0, 1}, {0, 1, 1}, {}, {}};
  EXPECT_EQ(EdgeBound(lobe, s).total(), 0);
  s.v_0.z = Lanes{0, 0, 1, 0};
  EXPECT_GT(EdgeBound(lobe, s).total(), 0);
  s.w_0.z = s.w_1.z = -1;
  EXPECT_EQ(EdgeBound(lobe, s).total(), 0);
  s.w_0.z = 1;
  EXPECT_GT(EdgeBound(lobe, s).total(), 0);
  s.w_1 = s.w_0 * 2.0;  // seen end on
  EXPECT_EQ(EdgeBound(lobe, s).total(), 0);
}

// An ablation, or what draws by the code of `forest`.
bool is_variant(const std::string& name) {
  return name == "silhouettes" || name.find(':') != name.npos;
}

class EdgeSamplers : public testing::TestWithParam<std::string> {
 protected:
  std::unique_ptr<EdgeSampler> make(const EdgeSamplerInput& input) const {
    return make_edge_sampler(GetParam(), input, 1);
  }
};

TEST_P(EdgeSamplers, DrawAsTheyState) {
  Rng rng(14, 0, 0);
  for (const NamedInput& named : test_inputs()) {
    const std::string& name = named.name;  // no binding: Clang 14 lets lambdas capture none
    const EdgeSamplerInput& input = named.input;
    const auto sampler = make(input);
    for (int i = 0; i < 6; ++i) {
      const EdgeQuery q = random_query(i, rng);
      // An ablation draws by the code of its sampler, from weights of its own: each draw's
      // probability is compared exactly, and how often it comes at all needs fewer.
      const int draws = is_variant(GetParam()) ? 5000 : 20000;
      std::vector<double> stated, expected, observed;
      std::vector<size_t> begin;  // of an object's cells
      double sum = 0;
      for_every_edge(input, [&](EdgeRef id) {
        if (id.edge == EdgeId(0)) begin.push_back(expected.size());
        const double probability = sampler->probability(q, id);
        sum += probability;
        stated.push_back(probability);
        expected.push_back(probability * draws);
      });
      EXPECT_LE(sum, 1 + 1e-12) << name;       // 1e3 terms of rounding 1e-16
      if (GetParam() == "brute" && sum > 0) {  // nothing to draw if all is below the horizon
        EXPECT_NEAR(sum, 1, 1e-12) << name;
      }
      expected.push_back((1 - sum) * draws);  // failures
      if (expected.back() < 1e-6) expected.back() = 0;
      observed.assign(expected.size(), 0);
      for (int k = 0; k < draws; ++k) {
        const auto drawn = sampler->sample(q, rng);
        if (!drawn) {
          ++observed.back();
          continue;
        }
        const EdgeSample& s = *drawn;
        const size_t cell = begin[s.edge.object.index()] + s.edge.edge.index();
        ++observed[cell];
        ASSERT_EQ(s.probability, stated[cell]) << name;
        ASSERT_EQ(s.pdf_t, sampler->pdf_t(q, s.edge, s.t)) << name;
        ASSERT_GT(s.pdf_t, 0) << name;
      }
      EXPECT_GT(test::chi_square_test(observed, expected).p_value, kSignificance)
          << name << " " << i;
    }
  }
}

// Draws that share their work, or are spread, still come as often as they state.
TEST_P(EdgeSamplers, SeveralAtOnceAreDrawnAsTheyState) {
  Rng rng(20, 0, 0);
  std::vector<std::optional<EdgeSample>> samples;
  for (const NamedInput& named : test_inputs()) {
    const std::string& name = named.name;  // no binding: Clang 14 lets lambdas capture none
    const EdgeSamplerInput& input = named.input;
    const auto sampler = make(input);
    for (const int several : {2, 7}) {
      const EdgeQuery q = random_query(rng);
      const int rounds = (is_variant(GetParam()) ? 5000 : 20000) / several;
      std::vector<double> stated, expected;
      std::vector<size_t> begin;  // of an object's cells
      double sum = 0;
      for_every_edge(input, [&](EdgeRef id) {
        if (id.edge == EdgeId(0)) begin.push_back(expected.size());
        stated.push_back(sampler->probability(q, id));
        sum += stated.back();
        expected.push_back(stated.back() * rounds * several);
      });
      expected.push_back((1 - sum) * rounds * several);  // failures
      if (expected.back() < 1e-6) expected.back() = 0;
      std::vector<double> observed(expected.size());
      for (int k = 0; k < rounds; ++k) {
        std::vector<Rng> rngs;
        for (int i = 0; i < several; ++i) rngs.emplace_back(21, k, i);
        sampler->sample_several(q, rngs, samples);
        ASSERT_EQ(samples.size(), rngs.size());
        for (const auto& s : samples) {
          if (!s) {
            ++observed.back();
            continue;
          }
          const size_t cell = begin[s->edge.object.index()] + s->edge.edge.index();
          ++observed[cell];
          ASSERT_EQ(s->probability, stated[cell]) << name;
          ASSERT_EQ(s->pdf_t, sampler->pdf_t(q, s->edge, s->t)) << name;
        }
      }
      // Evenly spread draws differ less from what is expected than the test's independent ones.
      EXPECT_GT(test::chi_square_test(observed, expected).p_value, kSignificance)
          << name << " " << several;
    }
  }
}

TEST_P(EdgeSamplers, OneOfSeveralIsOneAlone) {
  Rng rng(22, 0, 0);
  const EdgeSamplerInput input = test_input(torus_mesh(12, 8));
  const auto sampler = make(input);
  std::vector<std::optional<EdgeSample>> samples(3);
  for (uint64_t i = 0; i < 100; ++i) {
    const EdgeQuery q = random_query(rng);
    Rng alone(23, i, 0), several(23, i, 0);
    const auto s = sampler->sample(q, alone);
    sampler->sample_several(q, {&several, 1}, samples);
    ASSERT_EQ(samples.size(), 1u);
    ASSERT_EQ(samples[0].has_value(), s.has_value());
    EXPECT_EQ(several.uniform(), alone.uniform());
    if (!s) continue;
    EXPECT_EQ(samples[0]->edge, s->edge);
    EXPECT_EQ(samples[0]->t, s->t);
    EXPECT_EQ(samples[0]->probability, s->probability);
    EXPECT_EQ(samples[0]->pdf_t, s->pdf_t);
    sampler->sample_several(q, {}, samples);
    EXPECT_TRUE(samples.empty());
  }
}

TEST_P(EdgeSamplers, MissNoEdgeThatContributes) {
  Rng rng(15, 0, 0);
  for (const NamedInput& named : test_inputs()) {
    const std::string& name = named.name;  // no binding: Clang 14 lets lambdas capture none
    const EdgeSamplerInput& input = named.input;
    const auto sampler = make(input);
    for (int i = 0; i < 10; ++i) {
      const EdgeQuery q = random_query(rng);
      for_every_edge(input, [&](EdgeRef id) {
        const EdgeMesh& edges = input.object(id.object);
        if (!is_candidate(edges, id.edge, q.p)) {
          EXPECT_EQ(sampler->probability(q, id), 0) << name;
          return;
        }
        const double t = rng.uniform();
        if (integrand(q, segment_of(edges, id.edge, q), t) > 0) {
          EXPECT_GT(sampler->probability(q, id), 0) << name;
          EXPECT_GT(sampler->pdf_t(q, id, t), 0) << name;
        }
      });
    }
  }
}

// Which edge and which part of it, of all draws at once.
TEST_P(EdgeSamplers, DensityAlongTheEdge) {
  Rng rng(16, 0, 0);
  const EdgeSamplerInput input = test_input(cube_mesh());
  const auto sampler = make(input);
  // Ablations draw along edges as their samplers do.
  const bool ablation = is_variant(GetParam());
  const int queries = ablation ? 10 : 40, draws = ablation ? 4500 : 18000;
  for (int i = 0; i < queries; ++i) {
    const EdgeQuery q = random_query(rng);
    constexpr int kBins = 20, kFine = 100;
    std::vector<double> expected;
    std::vector<size_t> begin;  // of an object's cells
    double sum = 0;
    for_every_edge(input, [&](EdgeRef id) {
      if (id.edge == EdgeId(0)) begin.push_back(expected.size());
      const double probability = sampler->probability(q, id);
      sum += probability;
      expected.resize(expected.size() + kBins);
      if (probability == 0) return;
      double* const bins = &expected[expected.size() - kBins];
      for (int b = 0; b < kBins * kFine; ++b)  // jittered: unbiased whatever the density's jumps
        bins[b / kFine] += draws * probability / (kBins * kFine) *
                           sampler->pdf_t(q, id, (b + rng.uniform()) / (kBins * kFine));
    });
    ASSERT_EQ(begin.size(), input.objects.size());
    expected.push_back((1 - sum) * draws);  // failures
    if (expected.back() < 1e-6) expected.back() = 0;
    std::vector<double> observed(expected.size());
    for (int k = 0; k < draws; ++k) {
      const auto s = sampler->sample(q, rng);
      const size_t part = s ? std::min(kBins - 1, static_cast<int>(s->t * kBins)) : 0;
      ++(s ? observed[begin[s->edge.object.index()] + s->edge.edge.index() * kBins + part]
           : observed.back());
    }
    EXPECT_GT(test::chi_square_test(observed, expected).p_value, kSignificance) << i;
  }
}

// The estimator f |J| / (P p) against the sum of all edges' integrals.
TEST_P(EdgeSamplers, EstimateTheSumOverAllEdges) {
  Rng rng(17, 0, 0);
  for (const NamedInput& named : test_inputs()) {
    const std::string& name = named.name;  // no binding: Clang 14 lets lambdas capture none
    const EdgeSamplerInput& input = named.input;
    const auto sampler = make(input);
    for (int i = 0; i < 6; ++i) {
      EdgeQuery q = random_query(i, rng);
      // Tails that span hundreds of decades if the lobe is narrow: no variance to speak of.
      const bool long_tail = is_beckmann(q.lobe) || is_phong(q.lobe);
      q.lobe.alpha = std::max(q.lobe.alpha, long_tail ? 0.4 : 0.05);
      double exact = 0;
      for_every_edge(input, [&](EdgeRef id) {
        if (is_candidate(input.object(id.object), id.edge, q.p))
          exact += integral(q, segment_of(input.object(id.object), id.edge, q), 400);
      });
      const auto value_of = [&](const std::optional<EdgeSample>& s) {
        if (!s) return 0.0;
        const EdgeSegment segment = segment_of(input.object(s->edge.object), s->edge.edge, q);
        return integrand(q, segment, s->t) / (s->probability * s->pdf_t);
      };
      RunningMean estimate, several;
      const int draws = is_variant(GetParam()) ? 5000 : 20000;
      for (int k = 0; k < draws; ++k) estimate.add(value_of(sampler->sample(q, rng)));
      std::vector<std::optional<EdgeSample>> samples;
      for (int k = 0; k < draws * 3 / 40; ++k) {
        std::vector<Rng> rngs;
        for (int j = 0; j < 5; ++j) rngs.emplace_back(24 + i, k, j);
        sampler->sample_several(q, rngs, samples);
        double mean = 0;
        for (const auto& s : samples) mean += value_of(s) / 5;
        several.add(mean);
      }
      if (exact > 0) {
        EXPECT_LT(std::fabs(estimate.z_score(exact)), 5) << name << " " << i;
        EXPECT_LT(std::fabs(several.z_score(exact)), 5) << name << " " << i;
      }
    }
  }
}

TEST_P(EdgeSamplers, NeverDrawTheOwnFace) {
  Rng rng(18, 0, 0);
  const Mesh mesh = torus_mesh(12, 8);
  const EdgeSamplerInput input = test_input(mesh);
  const auto sampler = make(input);
  for (uint32_t f = 0; f < mesh.faces.size(); f += 7) {
    const FaceId face(f);
    EdgeQuery q = random_query(rng);
    q.face = {ShapeId(0), face};
    const EdgeMesh& edges = input.objects[0];
    const auto [a, b, c] = mesh.face(face);
    q.p = (edges.positions[a] + edges.positions[b] + edges.positions[c]) / 3.0;
    q.n = edges.plane(face).n;
    q.wi = normalize(q.n + random_direction(rng) * 0.7);
    const auto is_own = [&](EdgeRef id) {
      const auto around = input.object(id.object).faces_around(id.edge);
      return std::find(around.begin(), around.end(), q.face) != around.end();
    };
    for_every_edge(input, [&](EdgeRef id) {
      if (is_own(id)) {
        EXPECT_EQ(sampler->probability(q, id), 0);
      }
    });
    for (int k = 0; k < 200; ++k) {
      if (const auto s = sampler->sample(q, rng)) {
        EXPECT_FALSE(is_own(s->edge));
      }
    }
  }
}

TEST_P(EdgeSamplers, HoldWithoutEdges) {
  Rng rng(19, 0, 0);
  const EdgeSamplerInput nothing;
  const EdgeSamplerInput still{.objects = {build_edge_mesh(cube_mesh(), true)},
                               .environment_luminance = 1};
  EdgeQuery q = random_query(rng);
  q.velocity = {};
  EXPECT_FALSE(make(nothing)->sample(q, rng));
  if (GetParam() == "brute") {
    EXPECT_FALSE(make(still)->sample(q, rng));
  }
}

// Of n draws of a query an edge of probability P has n P, but for the parts at the ends of its own;
// and its points are as even along it.
TEST(EdgeForestDraws, AreSpreadEvenly) {
  Rng rng(25, 0, 0);
  const EdgeSamplerInput input = test_input(cube_mesh());
  const auto sampler = make_edge_sampler("forest", input, 1);
  constexpr int kDraws = 2000, kCells = 4000;
  std::vector<std::optional<EdgeSample>> samples;
  for (uint64_t i = 0; i < 10; ++i) {
    const EdgeQuery q = random_query(rng);
    std::vector<Rng> rngs;
    for (uint64_t k = 0; k < kDraws; ++k) rngs.emplace_back(26, i, k);
    sampler->sample_several(q, rngs, samples);
    for_every_edge(input, [&](EdgeRef id) {
      const double probability = sampler->probability(q, id);
      std::vector<double> places;
      for (const auto& s : samples)
        if (s && s->edge == id) places.push_back(s->t);
      const auto count = static_cast<double>(places.size());
      EXPECT_LE(std::fabs(count - kDraws * probability), 2);
      if (places.size() < 20) return;
      // The midpoint rule misses what the density jumps by in a few cells.
      std::sort(places.begin(), places.end());
      double below = 0;
      for (int c = 0; c < kCells; ++c) {
        below += sampler->pdf_t(q, id, (c + 0.5) / kCells) / kCells;
        const auto found = std::upper_bound(places.begin(), places.end(), (c + 1.0) / kCells);
        const auto share = static_cast<double>(found - places.begin());
        ASSERT_LE(std::fabs(share - count * below), 4 + 0.01 * count) << i;
      }
    });
  }
}

// Rows, and each of their settings at each value; `silhouettes` draws by the code of `forest`.
std::vector<std::string> sampler_names() {
  std::vector<std::string> names;
  for (const EdgeSamplerType& type : edge_sampler_types()) {
    names.push_back(type.name);
    if (type.name == "silhouettes") continue;
    for (const std::string& name : variants_of(type)) names.push_back(name);
  }
  // Settings combine.
  names.emplace_back("forest:width=4:look-ahead=none");
  names.emplace_back("forest:look-ahead=none:expansion=off:axes=any:weights=hard");
  return names;
}
INSTANTIATE_TEST_SUITE_P(All, EdgeSamplers, testing::ValuesIn(sampler_names()), name_of_string);

TEST(EdgeSamplerTable, SettingsAreInTheName) {
  const EdgeSamplerType type = edge_sampler_type("forest:look-ahead=none:width=4");
  EXPECT_EQ(type.name, "forest:width=4:look-ahead=none");
  EXPECT_EQ(edge_sampler_type("forest:width=8").name, "forest");
  const auto refused = [](const std::string& name) -> std::string {
    try {
      edge_sampler_type(name);
    } catch (const InputError& error) {
      return error.what();
    }
    return "taken";
  };
  EXPECT_EQ(refused("li2019:width=4"),
            "error: \"li2019\" has no setting \"width\" (known: sphere)");
  EXPECT_EQ(refused("uniform:width=4"),
            "error: \"uniform\" has no setting \"width\" (it has none)");
  EXPECT_EQ(refused("forest:width=3"),
            "error: \"forest\": the setting width is one of 8, 4, 2, not \"3\"");
  EXPECT_EQ(refused("forest:width=4:width=2"), "error: \"forest\": width is given twice");
  EXPECT_NE(refused("forest:"), "taken");
}

TEST(EdgeSamplerTable, UnknownNamesListTheKnown) {
  try {
    make_edge_sampler("forrest", {}, 1);
    FAIL();
  } catch (const InputError& error) {
    std::string known;
    for (const EdgeSamplerType& type : edge_sampler_types()) {
      known += (known.empty() ? "" : ", ") + type.name;
    }
    EXPECT_EQ(error.what(), "error: unknown edge sampler \"forrest\" (known: " + known + ")");
  }
}

}  // namespace
}  // namespace limn
