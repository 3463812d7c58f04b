// Linearly transformed cosines: the fitted lobes, their means over boxes, and points along edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../../edgetree/ltc.h"
#include "../../edgetree/ltc_table.h"
#include "../../src/microfacet.h"
#include "../support/chi_square.h"
#include "../support/quadrature.h"
#include "../support/running_mean.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

using Kind = LobeSummary::Kind;

// Fixed seeds: a p-value below this is an error, not luck.
constexpr double kSignificance = 1e-6;

Vec3d random_direction(Rng& rng) {
  const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

struct Case {
  LobeSummary lobe;
  Vec3d n, wi;
  LtcLobe ltc() const { return LtcLobe(lobe, n, wi); }
};

// All kinds, roughness over the whole range and beyond, also grazing views.
Case random_case(Rng& rng) {
  Case c;
  c.lobe.kind = static_cast<Kind>(static_cast<int>(3 * rng.uniform()));
  c.lobe.alpha = std::exp(std::log(1e-4) * rng.uniform()) * 1.5;
  c.lobe.albedo = 1;
  c.n = random_direction(rng);
  const double cos_i = rng.uniform() < 0.3 ? std::exp(-9 * rng.uniform()) : rng.uniform();
  const double phi = 2 * kPi * rng.uniform(), sin_i = std::sqrt(1 - cos_i * cos_i);
  c.wi = Frame(c.n).to_world({sin_i * std::cos(phi), sin_i * std::sin(phi), cos_i});
  return c;
}

// An edge above, across or below the horizon, near, far, short or long, at any scale.
struct Segment {
  Vec3d w_0, w_1;
};
Segment random_segment(Rng& rng) {
  const double scale = std::exp(std::log(1e3) * (2 * rng.uniform() - 1));
  const double size = std::exp(std::log(1e4) * (rng.uniform() - 0.5));
  const Vec3d a = random_direction(rng) * scale;
  return {a, a + random_direction(rng) * (scale * size)};
}

// Quadrature of pdf_t over [begin, end]: panels end at both horizons and grow by a factor from the
// points closest to p in the world and in the lobe's space.
double mass(const LtcLobe& lobe, const LtcEdge& edge, const Segment& s, double begin, double end) {
  const Vec3d along = s.w_1 - s.w_0;
  std::vector<double> cuts{begin, end};
  const auto cut = [&](double h_0, double h_1) {
    if (h_0 * h_1 < 0) cuts.push_back(h_0 / (h_0 - h_1));
  };
  cut(dot(lobe.n(), s.w_0), dot(lobe.n(), s.w_1));
  cut(lobe.transform(s.w_0).z, lobe.transform(s.w_1).z);
  for (const bool transformed : {false, true}) {
    const Vec3d a = transformed ? lobe.transform(s.w_0) : s.w_0;
    const Vec3d b = transformed ? lobe.transform(along) : along;
    const double foot = -dot(a, b) / length_squared(b);
    const double reach = length(cross(a, b)) / length_squared(b);
    for (double step = reach / 4; step < 2 + std::fabs(foot); step *= 1.5) {
      cuts.push_back(foot - step);
      cuts.push_back(foot + step);
    }
  }
  std::sort(cuts.begin(), cuts.end());
  double sum = 0;
  for (size_t i = 0; i + 1 < cuts.size(); ++i) {
    const double low = std::max(begin, cuts[i]), high = std::min(end, cuts[i + 1]);
    if (low < high) sum += test::integrate([&](double t) { return edge.pdf_t(t); }, low, high, 2);
  }
  return sum;
}

// The density over the sphere is the cosine's, carried along by M: it integrates to 1 for exactly
// one factor, the determinant.
TEST(LtcLobe, IntegratesToOne) {
  Rng rng(1, 0, 0);
  for (int i = 0; i < 200; ++i) {
    const LtcLobe lobe = random_case(rng).ltc();
    const Vec3d a = lobe.transform({1, 0, 0}), b = lobe.transform({0, 1, 0}),
                c = lobe.transform({0, 0, 1});  // columns of M^-1
    EXPECT_NEAR(std::fabs(determinant(a, b, c)) / lobe.det(), 1, 1e-9);
  }
}

TEST(LtcEdge, DensityIntegratesToOne) {
  Rng rng(2, 0, 0);
  for (int i = 0; i < 3000; ++i) {
    const LtcLobe lobe = random_case(rng).ltc();
    const Segment s = random_segment(rng);
    const LtcEdge edge(lobe, s.w_0, s.w_1);
    const bool above = dot(lobe.n(), s.w_0) > 0 || dot(lobe.n(), s.w_1) > 0;
    EXPECT_EQ(edge.integral() > 0, above);
    if (above) {
      EXPECT_NEAR(mass(lobe, edge, s, 0, 1), 1, 1e-9) << i;
    }
  }
}

TEST(LtcEdge, DensityFollowsTheLobe) {
  Rng rng(3, 0, 0);
  for (int i = 0; i < 2000; ++i) {
    const LtcLobe lobe = random_case(rng).ltc();
    const Segment s = random_segment(rng);
    const LtcEdge edge(lobe, s.w_0, s.w_1);
    if (!(edge.integral() > 0)) continue;
    const double t = rng.uniform();
    const Vec3d w = s.w_0 + (s.w_1 - s.w_0) * t;
    const double r = length(w);
    const double expected = lobe.value(w / r) / (r * r * r * edge.integral());
    EXPECT_NEAR(edge.pdf_t(t), expected, 1e-9 * expected) << i;
  }
}

// Bins between quantiles of a first set of draws, so that narrow peaks are resolved.
TEST(LtcEdge, SamplesFollowTheDensity) {
  Rng rng(4, 0, 0);
  constexpr int kEdges = 300, kBins = 16, kDraws = 4000;
  for (int i = 0; i < kEdges; ++i) {
    const LtcLobe lobe = random_case(rng).ltc();
    const Segment s = random_segment(rng);
    const LtcEdge edge(lobe, s.w_0, s.w_1);
    if (!(edge.integral() > 0)) continue;
    std::vector<double> pilot(kBins * 8);
    for (double& t : pilot) t = edge.sample_t(rng.uniform());
    std::sort(pilot.begin(), pilot.end());
    std::vector<double> ends{0}, expected, observed(kBins);
    for (int b = 1; b < kBins; ++b) ends.push_back(pilot[b * 8]);
    ends.push_back(1);
    for (int b = 0; b < kBins; ++b)
      expected.push_back(kDraws * mass(lobe, edge, s, ends[b], ends[b + 1]));
    for (int k = 0; k < kDraws; ++k) {
      const double t = edge.sample_t(rng.uniform());
      ASSERT_TRUE(t >= 0 && t <= 1);
      ++observed[std::upper_bound(ends.begin() + 1, ends.end() - 1, t) - ends.begin() - 1];
    }
    EXPECT_GT(test::chi_square_test(observed, expected).p_value,
              test::sidak_threshold(kSignificance, kEdges))
        << i;
  }
}

}  // namespace
}  // namespace limn
