// Linearly transformed cosines: the fitted lobes, their means over boxes, and points along edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "../support/chi_square.h"
#include "../support/quadrature.h"
#include "../support/running_mean.h"
#include "edgetree/lobe/ltc.h"
#include "edgetree/lobe/ltc_table.h"
#include "limn/core/bsdf.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

const LobeModel* const kModels[] = {&kHemisphere, &ggx_lobe(), &beckmann_lobe()};

#include "edgetree/lobe/ltc_tables.inc"

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
  c.lobe.model = kModels[static_cast<int>(3 * rng.uniform())];
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

std::shared_ptr<Bsdf> bsdf_of(const Case& c) {
  if (c.lobe.model == &kHemisphere) return make_diffuse(Rgb<double>{1, 1, 1});
  RoughConductorValues v;
  v.alpha = c.lobe.alpha;
  v.distribution = c.lobe.model == &ggx_lobe() ? RoughConductorValues::Distribution::kGgx
                                               : RoughConductorValues::Distribution::kBeckmann;
  return make_roughconductor(v);
}

// L1 distance of f / norm and the LTC, 2 E_f[max(0, 1 - ltc norm / f)], with directions from the
// BSDF's own sampling. Between the table's entries it may exceed the worst at entries and middles
// of cells only by the sampling error.
TEST(LtcLobe, FitsAsWellAsTheTableStates) {
  Rng rng(5, 0, 0);
  for (int i = 0; i < 400; ++i) {
    Case c = random_case(rng);
    c.lobe.alpha = std::clamp(c.lobe.alpha, kLtcMinAlpha, kLtcMaxAlpha);
    const LtcLobe lobe = c.ltc();
    const auto bsdf = bsdf_of(c);
    RunningMean distance;
    for (int k = 0; k < 2000; ++k) {
      const double u1 = rng.uniform();
      const auto w = bsdf->sample(c.n, c.wi, u1, rng.uniform());
      if (!w) {
        distance.add(0);
        continue;
      }
      const BsdfValue f = bsdf->eval_with_pdf(c.n, c.wi, *w);
      const double value = f.value.r / lobe.norm();
      distance.add(f.pdf > 0 ? 2 * std::max(0.0, value - lobe.ltc(*w)) / f.pdf : 0);
    }
    const double worst = c.lobe.model == &kHemisphere  ? 0
                         : c.lobe.model == &ggx_lobe() ? kLtcWorstGgx
                                                       : kLtcWorstBeckmann;
    // A diffuse lobe is matched exactly, up to rounding; norm is interpolated.
    EXPECT_LT(distance.mean(), worst + 5 * distance.standard_error() + 1e-12)
        << i << " alpha " << c.lobe.alpha << " cos " << dot(c.n, c.wi);
  }
}

// Wherever the scattering function is positive, and along every edge there.
TEST(LtcLobe, IsPositiveWhereTheLobeIs) {
  Rng rng(6, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    const Case c = random_case(rng);
    const LtcLobe lobe = c.ltc();
    const Segment s = random_segment(rng);
    const double t = rng.uniform();
    const Vec3d w = s.w_0 + (s.w_1 - s.w_0) * t;
    const bool positive = bsdf_of(c)->eval(c.n, c.wi, normalize(w)).r > 0;
    if (positive) {
      EXPECT_GT(lobe.value(normalize(w)), 0) << i;
      const LtcEdge edge(lobe, s.w_0, s.w_1);
      EXPECT_GT(edge.integral(), 0) << i;
      EXPECT_GT(edge.pdf_t(t), 0) << i;
    }
    if (dot(c.n, w) <= 0) {
      EXPECT_EQ(lobe.value(normalize(w)), 0);
    }
  }
}

// Needles, edges through p, on the horizon, collinear with p, without length, huge, tiny.
TEST(LtcEdge, StaysFiniteInExtremeGeometry) {
  Rng rng(7, 0, 0);
  for (int i = 0; i < 20000; ++i) {
    const Case c = random_case(rng);
    const LtcLobe lobe = c.ltc();
    const double scale = std::exp(std::log(1e10) * (2 * rng.uniform() - 1));
    const Vec3d a = random_direction(rng) * scale, b = random_direction(rng);
    const double small = std::exp(-30 * rng.uniform());
    const Frame frame(c.n);
    const Segment s[] = {{a, a + b * (scale * small)},           // short
                         {a, a * -small + b * (scale * 1e-12)},  // past p
                         {a, a * -1.0},                          // through p
                         {a, a * (1 + small)},                   // collinear
                         {a, a},                                 // no length
                         {{}, a},                                // p is an end
                         {frame.s * scale, frame.t * scale},     // on the horizon
                         {frame.s * scale, c.n * scale},
                         {a, b * (scale / small)}};  // long
    for (const Segment& e : s) {
      const LtcEdge edge(lobe, e.w_0, e.w_1);
      ASSERT_TRUE(std::isfinite(edge.integral()) && edge.integral() >= 0);
      if (edge.integral() == 0) continue;
      for (int k = 0; k < 4; ++k) {
        const double t = edge.sample_t(k == 0 ? 0 : k == 1 ? 1 - 0x1p-53 : rng.uniform());
        ASSERT_TRUE(t >= 0 && t <= 1);
        ASSERT_TRUE(edge.pdf_t(t) >= 0);
      }
    }
  }
}

// One box in the first lane.
double box_mean(const LtcLobe& lobe, const Vec3d& center, const Vec3d& half) {
  const auto lane = [](double a) { return splat(static_cast<float>(a)); };
  return lobe.mean_over_boxes({lane(center.x), lane(center.y), lane(center.z)},
                              {lane(half.x), lane(half.y), lane(half.z)})[0];
}

// Positive if any corner is above the horizon, zero if all are clearly below, the same at all
// scales, never more than the peak allows.
TEST(LtcBoxes, ArePositiveAboveTheHorizon) {
  Rng rng(8, 0, 0);
  for (int i = 0; i < 50000; ++i) {
    const Case c = random_case(rng);
    const LtcLobe lobe = c.ltc();
    const double size = std::exp(std::log(1e6) * (rng.uniform() - 0.8));
    const auto thin = [&] { return rng.uniform() < 0.2 ? 0 : rng.uniform() * size; };
    const double x = thin(), y = thin(), z = thin();
    const Vec3d half{x, y, z}, center = rng.uniform() < 0.02 ? Vec3d{} : random_direction(rng);
    const double top = dot(c.n, center) + std::fabs(c.n.x) * half.x + std::fabs(c.n.y) * half.y +
                       std::fabs(c.n.z) * half.z;
    const double mean = box_mean(lobe, center, half);
    ASSERT_TRUE(std::isfinite(mean)) << i;
    if (top > 0) {
      EXPECT_GT(mean, 0) << i;
    }
    if (top < -1e-6 * (1 + size)) {
      EXPECT_EQ(mean, 0) << i;
    }
    const double power = std::exp2(std::floor(30 * (rng.uniform() - 0.5)));
    EXPECT_EQ(box_mean(lobe, center * power, half * power), mean) << i;
  }
}

// The same for segments, half from the middle to an end.
TEST(LtcBoxes, SegmentsArePositiveAboveTheHorizon) {
  Rng rng(11, 0, 0);
  const auto lane = [](double a) { return splat(static_cast<float>(a)); };
  const auto lanes = [&](const Vec3d& v) { return Floats3{lane(v.x), lane(v.y), lane(v.z)}; };
  for (int i = 0; i < 50000; ++i) {
    const Case c = random_case(rng);
    const double size = std::exp(std::log(1e6) * (rng.uniform() - 0.8));
    const Vec3d along = random_direction(rng) * size, center = random_direction(rng);
    const double mean = c.ltc().mean_over_segments(lanes(center), lanes(along))[0];
    const double top = dot(c.n, center) + std::fabs(dot(c.n, along));
    ASSERT_TRUE(std::isfinite(mean)) << i;
    if (top > 0) {
      EXPECT_GT(mean, 0) << i;
    }
    if (top < -1e-6 * (1 + size)) {
      EXPECT_EQ(mean, 0) << i;
    }
  }
}

bool hits(const Vec3d& center, const Vec3d& half, const Vec3d& w) {
  double near = 0, far = 1e300;
  for (int i = 0; i < 3; ++i) {
    const double a = (center[i] - half[i]) / w[i], b = (center[i] + half[i]) / w[i];
    near = std::max(near, std::min(a, b));
    far = std::min(far, std::max(a, b));
  }
  return near <= far;
}

// What a box outside of p receives of the lobe, from the BSDF's own directions, and its solid
// angle, from uniform directions in the cone around it.
struct BoxReference {
  double mass = 0, solid_angle = 0;
};
BoxReference reference(const Case& c, const Vec3d& center, const Vec3d& half, Rng& rng) {
  const auto bsdf = bsdf_of(c);
  const Frame frame(normalize(center));
  const double height = 1 - std::sqrt(1 - length_squared(half) / length_squared(center));
  constexpr int kDraws = 4000;
  BoxReference r;
  for (int k = 0; k < kDraws; ++k) {
    const double z = 1 - rng.uniform() * height, phi = 2 * kPi * rng.uniform();
    const double sine = std::sqrt(1 - z * z);
    const Vec3d w = frame.to_world({sine * std::cos(phi), sine * std::sin(phi), z});
    if (hits(center, half, w)) r.solid_angle += 2 * kPi * height / kDraws;
    const double u = rng.uniform();
    const auto drawn = bsdf->sample(c.n, c.wi, u, rng.uniform());
    if (!drawn || !hits(center, half, *drawn)) continue;
    const BsdfValue f = bsdf->eval_with_pdf(c.n, c.wi, *drawn);
    if (f.pdf > 0) r.mass += f.value.r / f.pdf / kDraws;
  }
  return r;
}

// Log ratios of estimate and reference over boxes near the lobe, against those of the value at the
// center: a quarter of the second moment or less for microfacets, less for the smooth cosine.
TEST(LtcBoxes, MeansBeatTheValueAtTheCenter) {
  for (const LobeModel* model : kModels) {
    Rng rng(10, 0, 0);
    double moment = 0, moment_center = 0;
    for (int i = 0; i < 250; ++i) {
      Case c = random_case(rng);
      c.lobe.model = model;
      c.lobe.alpha = 0.02 + 0.2 * rng.uniform();
      const double x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
      const Vec3d half = normalize(Vec3d{x, y, z}) * (0.1 + 0.8 * rng.uniform());
      const auto drawn = bsdf_of(c)->sample(c.n, c.wi, rng.uniform(), 0.5);
      if (!drawn) continue;
      const Vec3d center = normalize(*drawn + random_direction(rng) * length(half));
      const LtcLobe lobe = c.ltc();
      const BoxReference r = reference(c, center, half, rng);
      const double value = lobe.value(center);
      if (value == 0 || r.mass < 0.02) continue;
      const double mean = r.mass / (r.solid_angle * lobe.norm());
      moment += std::pow(std::log(box_mean(lobe, center, half) / mean), 2);
      moment_center += std::pow(std::log(value / mean), 2);
    }
    EXPECT_LT(moment, (model == &kHemisphere ? 1 : 0.25) * moment_center)
        << (model == &kHemisphere  ? "diffuse"
            : model == &ggx_lobe() ? "ggx"
                                   : "beckmann");
  }
}

// A box that shrinks to a point has the density of its direction.
TEST(LtcBoxes, SmallBoxesHaveTheDensityOfTheirCenter) {
  Rng rng(9, 0, 0);
  for (int i = 0; i < 1000; ++i) {
    Case c = random_case(rng);
    c.lobe.model = &kHemisphere;
    const Vec3d w = random_direction(rng);
    const double mean = box_mean(c.ltc(), w, Vec3d{1, 1, 1} * 1e-9), value = c.ltc().value(w);
    EXPECT_NEAR(mean, value, 0x1p-20);
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
    const double power = std::exp2(std::floor(40 * (rng.uniform() - 0.5)));
    const LtcEdge scaled_edge(lobe, s.w_0 * power, s.w_1 * power);
    EXPECT_EQ(scaled_edge.pdf_t(t), edge.pdf_t(t)) << i;
    EXPECT_EQ(scaled_edge.sample_t(0.3), edge.sample_t(0.3)) << i;
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
