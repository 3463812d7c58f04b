// Values and derivatives of the BSDFs, and how they are read.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>

#include "limn/core/error.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/rng.h"
#include "support/bsdf_cases.h"
#include "support/held_textures.h"
#include "support/meshes.h"
#include "support/test_properties.h"

namespace limn {
namespace {

using test::around;
using test::BsdfCase;
using test::TestProperties;
using Distribution = RoughConductorValues::Distribution;

struct Reference {
  Distribution distribution;
  double alpha;
  Rgb<double> eta, k;
  Vec3d wi, wo;  // around n = (0, 0, 1), single precision
  Rgb<double> value;
  double pdf;
};

// eval and pdf of Mitsuba 3.9.1, variant scalar_rgb (single precision), through its Python module.
const Reference kReferences[] = {
    {Distribution::kGgx,
     0.01,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.268351167, -0.1143438, 0.956510901},
     {767.40741, 767.40741, 767.40741},
     767.40918},
    {Distribution::kGgx,
     0.01,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.775227547, -0.335464418, 0.535243809},
     {600.782532, 395.622833, 334.245819},
     634.539246},
    {Distribution::kGgx,
     0.1,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.898061395, -0.40969792, 0.160104305},
     {6.28691387, 6.84499264, 12.7111692},
     14.4504499},
    {Distribution::kGgx,
     0.1,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.311812282, -0.163921461, 0.935896814},
     {6.76452398, 6.76452398, 6.76452398},
     6.76691914},
    {Distribution::kGgx,
     0.3,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.682212353, -0.358642876, 0.637151122},
     {1.24993205, 0.819192529, 0.687512696},
     1.36048245},
    {Distribution::kGgx,
     0.3,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.792880654, -0.605257392, 0.070737198},
     {0.0119729908, 0.0133889336, 0.0262840725},
     0.0734689534},
    {Distribution::kGgx,
     0.5,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.085627988, -0.0513279513, 0.995004177},
     {0.311802834, 0.311802834, 0.311802834},
     0.311998874},
    {Distribution::kGgx,
     0.5,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.657359838, -0.704501569, 0.267498821},
     {0.128785744, 0.0859950185, 0.0737230629},
     0.208596006},
    {Distribution::kGgx,
     1,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.674484611, -0.545429647, 0.497571051},
     {0.0174511932, 0.0304896031, 0.0911457166},
     0.142038897},
    {Distribution::kGgx,
     1,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.254421681, -0.740858078, 0.621609986},
     {0.062402226, 0.062402226, 0.062402226},
     0.0813951492},
    {Distribution::kBeckmann,
     0.01,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.772131145, -0.329003245, 0.543663859},
     {1278.3667, 841.436829, 710.483398},
     1349.96912},
    {Distribution::kBeckmann,
     0.01,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.911716878, -0.394527495, 0.114544362},
     {0.0109257093, 0.0115118958, 0.0196340103},
     0.0205035359},
    {Distribution::kBeckmann,
     0.1,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.233891293, -0.106701806, 0.966389954},
     {7.99683905, 7.99683905, 7.99683905},
     7.99683905},
    {Distribution::kBeckmann,
     0.1,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.772157371, -0.405927449, 0.488872081},
     {7.90408278, 5.21857309, 4.42291737},
     8.35235214},
    {Distribution::kBeckmann,
     0.3,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.859602988, -0.451898128, 0.238476053},
     {1.20787024, 1.42015183, 3.0329752},
     3.33945203},
    {Distribution::kBeckmann,
     0.3,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.367055267, -0.280197144, 0.886994898},
     {0.839591026, 0.839591026, 0.839591026},
     0.839591026},
    {Distribution::kBeckmann,
     0.5,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.615282536, -0.368818581, 0.696706712},
     {0.536829829, 0.351109952, 0.293646693},
     0.565844417},
    {Distribution::kBeckmann,
     0.5,
     {1.5, 2.5, 0.3},
     {0.2, 1.0, 7.0},
     {0.914349198, 0.386580646, 0.12050277},
     {-0.680512249, -0.729314327, 0.070737198},
     {4.05454728e-08, 5.24576578e-08, 1.26147498e-07},
     3.31492714e-07},
    {Distribution::kBeckmann,
     1,
     {0, 0, 0},
     {1, 1, 1},
     {0.272192121, 0.11508099, 0.955336511},
     {-0.0776277408, -0.0627745539, 0.995004177},
     {0.0841819718, 0.0841819718, 0.0841819718},
     0.0841819718},
    {Distribution::kBeckmann,
     1,
     {0.201, 0.9237, 1.1022},
     {3.9133, 2.453, 2.1421},
     {0.77504611, 0.327684224, 0.540302277},
     {-0.323982656, -0.943414807, 0.070737198},
     {0.0384284817, 0.0254725832, 0.0216829702},
     0.182391196},
};

// The relative error of single precision: a rounding error of the half vector tilts it, which
// changes D by its logarithmic derivative, at most (4 + 2 x) x / tan for a tangent of x alpha.
double single_precision(const Reference& r) {
  const Vec3d h = normalize(r.wi + r.wo);
  const double tangent = std::hypot(h.x, h.y) / h.z;
  const double x = tangent / r.alpha;
  return 8 * std::numeric_limits<float>::epsilon() * (1 + (4 + 2 * x) / r.alpha);
}

TEST(Bsdf, MatchesMitsuba) {
  for (const Reference& r : kReferences) {
    RoughConductorValues v;
    v.distribution = r.distribution;
    v.alpha = r.alpha;
    v.eta = r.eta;
    v.k = r.k;
    const auto bsdf = make_roughconductor(v);
    const Vec3d n{0, 0, 1};
    const BsdfValue got = bsdf->eval_with_pdf(n, normalize(r.wi), normalize(r.wo));
    const double tolerance = single_precision(r);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(got.value[c] / r.value[c], 1, tolerance) << r.value.r;
    // Mitsuba's density has the rational masking term, ours the exact one.
    const double masking = r.distribution == Distribution::kBeckmann ? 0.0036 : 0;
    EXPECT_NEAR(got.pdf / r.pdf, 1, tolerance + masking);
  }
}

TEST(Bsdf, SeparateAndJointCallsAgree) {
  const Vec3d n = normalize(Vec3d{1, 2, -3});
  const Vec3d wi = around(n, 0.9, 1), wo = around(n, 0.85, 4.0), below = around(n, 1.6, 4.1);
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    const BsdfValue joint = c.bsdf->eval_with_pdf(n, wi, wo);
    for (int i = 0; i < 3; ++i) EXPECT_DOUBLE_EQ(joint.value[i], c.bsdf->eval(n, wi, wo)[i]);
    EXPECT_DOUBLE_EQ(joint.pdf, c.bsdf->pdf_solid_angle(n, wi, wo));
    for (const auto& [a, b] : {std::pair{wi, below}, std::pair{below, wi}}) {
      EXPECT_TRUE(is_black(c.bsdf->eval(n, a, b))) << c.name;
      EXPECT_EQ(c.bsdf->pdf_solid_angle(n, a, b), 0) << c.name;
    }
    EXPECT_FALSE(c.bsdf->sample(n, below, 0.3, 0.4));
  }
}

// To rounding those of calls for one; to the bit, however many go beside them.
TEST(Bsdf, CallsForManyAgreeWithCallsForOne) {
  struct Asked {
    Vec3d n, wi, wo;
    std::array<double, 2> u;
    BsdfValue value;
    Vec3d drawn;
  };
  Rng rng(5, 6, 7);
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    std::vector<Asked> all(21);
    for (Asked& a : all) {
      a.n = around({0, 0, 1}, kPi * rng.uniform(), 2 * kPi * rng.uniform());
      a.wi = around(a.n, 1.5 * rng.uniform(), 1);
      a.u = {rng.uniform(), rng.uniform()};
      a.wo = rng.uniform() < 0.2 ? around(a.n, kPi * rng.uniform(), 3)
                                 : c.bsdf->sample(a.n, a.wi, a.u[0], a.u[1]).value_or(-a.n);
    }
    // count of them from `first` on.
    const auto ask = [&](size_t first, size_t count) {
      std::vector<Bsdf::Evaluation> evaluations;
      std::vector<Bsdf::Draw> draws;
      for (size_t i = first; i < first + count; ++i) {
        Asked& a = all[i];
        evaluations.push_back({&a.n, &a.wi, &a.wo, &a.value});
        draws.push_back({&a.n, &a.wi, a.u.data(), &a.drawn});
      }
      c.bsdf->eval_with_pdf_each(evaluations);
      c.bsdf->sample_each(draws);
    };
    ask(0, all.size());
    const std::vector<Asked> together = all;
    for (const size_t count : {1, 3}) {
      for (size_t first = 0; first < all.size(); first += count) ask(first, count);
      for (size_t i = 0; i < all.size(); ++i) {
        for (int k = 0; k < 3; ++k) EXPECT_EQ(all[i].value.value[k], together[i].value.value[k]);
        EXPECT_EQ(all[i].value.pdf, together[i].value.pdf);
        EXPECT_EQ(all[i].drawn, together[i].drawn);
      }
    }
    // A half vector loses what the roughness magnifies.
    const double rounding = 1e-14 / c.alpha;
    for (const Asked& a : all) {
      const BsdfValue alone = c.bsdf->eval_with_pdf(a.n, a.wi, a.wo);
      for (int k = 0; k < 3; ++k) {
        EXPECT_NEAR(a.value.value[k], alone.value[k], rounding * alone.value[k]) << c.name;
      }
      EXPECT_NEAR(a.value.pdf, alone.pdf, rounding * alone.pdf) << c.name;
      const Vec3d drawn = c.bsdf->sample(a.n, a.wi, a.u[0], a.u[1]).value_or(Vec3d{});
      EXPECT_LT(length(a.drawn - drawn), 1e-13) << c.name;
    }
  }
}

TEST(Bsdf, IsReciprocal) {
  Rng rng(1, 1, 1);
  const Vec3d n = normalize(Vec3d{-1, 2, 0.5});
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    if (!c.reciprocal) continue;
    for (int i = 0; i < 50; ++i) {
      const double theta = 1.5 * rng.uniform();
      const Vec3d wi = around(n, theta, 1);
      const double spread = 2 * c.alpha * (rng.uniform() - 0.5);
      const Vec3d wo = around(n, std::fabs(theta + spread), 1 + kPi + spread);
      if (!(dot(n, wo) > 0)) continue;
      const double forth = c.bsdf->eval(n, wi, wo).g / dot(n, wo);
      const double back = c.bsdf->eval(n, wo, wi).g / dot(n, wi);
      EXPECT_NEAR(forth / back, 1, 1e-11) << c.name;
    }
  }
}

// A half vector that is tilted by a known angle, down to roughness 1e-3, against the textbook
// formulas with that angle.
TEST(Bsdf, IsAccurateAtSmallRoughness) {
  const Vec3d n{0, 0, 1};
  for (double alpha : {0.001, 0.01, 0.1}) {
    for (double x : {0.1, 1.0, 2.5}) {
      const double tilt = std::atan(x * alpha), theta = 0.6;
      const Vec3d wi{std::sin(theta + tilt), 0, std::cos(theta + tilt)};
      const Vec3d wo{-std::sin(theta - tilt), 0, std::cos(theta - tilt)};
      const double cos4 = std::pow(std::cos(tilt), 4);
      const double a2 = alpha * alpha;
      const auto g1 = [&](const Vec3d& v) {
        return 2 / (1 + std::sqrt(1 + a2 * (1 - v.z * v.z) / (v.z * v.z)));
      };
      RoughConductorValues v;
      v.alpha = alpha;
      v.distribution = Distribution::kGgx;
      const double ggx = g1(wi) * g1(wo) / (kPi * a2 * cos4 * std::pow(1 + x * x, 2) * 4 * wi.z);
      EXPECT_NEAR(make_roughconductor(v)->eval(n, wi, wo).r / ggx, 1, 1e-14 / alpha);
      v.distribution = Distribution::kBeckmann;
      const double beckmann = std::exp(-x * x) / (kPi * a2 * cos4 * 4 * wi.z);
      EXPECT_NEAR(make_roughconductor(v)->eval(n, wi, wo).r / beckmann, 1, 1e-14 / alpha);
    }
  }
}

// Towards the horizon the value falls with the cosine of wo, and has a limit in that of wi.
TEST(Bsdf, HasLimitsAtGrazingAngles) {
  const Vec3d n{0, 0, 1};
  const auto grazing = [](double cosine) {
    return Vec3d{-std::sqrt(1 - cosine * cosine), 0, cosine};
  };
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    for (double steep : {0.3, 1.2}) {
      const Vec3d v = around(n, steep, 0);
      const double slope = c.bsdf->eval(n, v, grazing(1e-7)).r / 1e-7;
      EXPECT_NEAR(c.bsdf->eval(n, v, grazing(1e-10)).r, slope * 1e-10, 2e-4 * slope * 1e-10);
      const double limit = c.bsdf->eval(n, grazing(1e-10), v).r;
      EXPECT_TRUE(std::isfinite(limit)) << c.name;
      EXPECT_NEAR(c.bsdf->eval(n, grazing(1e-7), v).r, limit, 2e-3 * limit) << c.name;
    }
    const Rgb<Dual> both = c.bsdf->eval(Vec3<Dual>{0., 0., Dual(1, Lanes{1, 1, 1, 1})},
                                        Vec3<Dual>{1., 0., 1e-150}, Vec3<Dual>{1., 0., 1e-160});
    EXPECT_TRUE(std::isfinite(both.r.v) && std::isfinite(both.r.d[0])) << c.name;
  }
}

// Unit vectors that turn with the lane's parameter.
template <class S>
Vec3<S> turning(const Vec3d& v, const Vec3d& velocity, const S& t) {
  return normalize(v + velocity * t);
}

// Fourth order central difference.
double difference(const std::function<double(double)>& f, double h) {
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

TEST(Bsdf, DerivativesMatchDifferences) {
  const Vec3d n = normalize(Vec3d{1, -2, 3});
  const Vec3d a{0.3, -0.5, 0.2}, b{-0.4, 0.1, 0.6}, e{0.7, 0.2, -0.3};
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    for (double polar : {0.2, 1.0, 1.4}) {
      const Vec3d wi = around(n, polar, 0.3);
      const Vec3d wo =
          around(n, polar + 0.4 * c.alpha * (polar > 1.2 ? -1 : 1), 0.3 + kPi + 0.5 * c.alpha);
      const auto shift = [](int lane) {
        Lanes l;
        l[lane] = 1;
        return Dual(0, l);
      };
      const Rgb<Dual> value =
          c.bsdf->eval(turning(n, a, shift(0)), turning(wi, b, shift(1)), turning(wo, e, shift(2)));
      const double h = 2e-3 * c.alpha;
      for (int channel = 0; channel < 3; ++channel) {
        const double expected[3] = {
            difference([&](double t) { return c.bsdf->eval(turning(n, a, t), wi, wo)[channel]; },
                       h),
            difference([&](double t) { return c.bsdf->eval(n, turning(wi, b, t), wo)[channel]; },
                       h),
            difference([&](double t) { return c.bsdf->eval(n, wi, turning(wo, e, t))[channel]; },
                       h)};
        for (int lane = 0; lane < 3; ++lane) {
          EXPECT_NEAR(value[channel].d[lane], expected[lane],
                      1e-7 * (value[channel].v / c.alpha + std::fabs(expected[lane])))
              << c.name << " at " << polar << ", lane " << lane;
        }
      }
    }
  }
}

// Of every channel of every value of a texture, tangents among them.
TEST(Bsdf, DerivativesOfTexturesMatchDifferences) {
  const Vec3d n = normalize(Vec3d{1, -2, 3});
  const Vec3d wi = around(n, 0.9, 0.3);
  const auto still = [](const Vec3d& v) { return Vec3<Dual>{v.x, v.y, v.z}; };
  int count = 0;
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    const auto* held = dynamic_cast<const test::HeldTextures*>(c.bsdf.get());
    if (!held) continue;
    const Vec3d wo = around(n, 0.9 + 0.3 * c.alpha, 0.3 + kPi - 0.2 * c.alpha);
    for (size_t k = 0; k < held->values().size(); ++k) {
      for (int channel = 0; channel < 3; ++channel, ++count) {
        std::vector<Rgb<Dual>> at = held->duals();
        at[k][channel].d[1] = 1;
        const Rgb<Dual> f = held->inside().eval(still(n), still(wi), still(wo), at.data());
        for (int out = 0; out < 3; ++out) {
          const auto moved = [&](double t) {
            std::vector<Rgb<double>> values = held->values();
            values[k][channel] += t;
            return held->inside().eval(n, wi, wo, values.data())[out];
          };
          const double expected = difference(moved, 1e-3 * c.alpha);
          EXPECT_NEAR(f[out].d[1], expected, 1e-7 * (f[out].v / c.alpha + std::fabs(expected)))
              << c.name << " value " << k << " channel " << channel;
        }
      }
    }
  }
  EXPECT_GT(count, 0);
}

TEST(Bsdf, DerivativesOfParametersMatchDifferences) {
  const Vec3d n = normalize(Vec3d{1, -2, 3});
  const Vec3d wi = around(n, 0.9, 0.3);
  for (const BsdfCase& c : test::bsdf_cases(true)) {
    const Vec3d wo = around(n, 0.9 + 0.3 * c.alpha, 0.3 + kPi - 0.2 * c.alpha);
    const auto moved = c.bsdf->clone();
    for (const ParameterRef& parameter : moved->parameters()) {
      for (Dual* v : parameter.values) v->d[2] = 1;
      const Rgb<Dual> value = moved->eval(Vec3<Dual>{n.x, n.y, n.z}, Vec3<Dual>{wi.x, wi.y, wi.z},
                                          Vec3<Dual>{wo.x, wo.y, wo.z});
      for (Dual* v : parameter.values) v->d[2] = 0;
      for (int channel = 0; channel < 3; ++channel) {
        const auto move = [&](double t) {
          for (Dual* v : parameter.values) v->v += t;
          if (parameter.changed) parameter.changed();
        };
        const auto at = [&](double t) {
          move(t);
          const double result = moved->eval(n, wi, wo)[channel];
          move(-t);
          return result;
        };
        // A tabulated transmittance has derivatives that are not those of its quadrature.
        const bool table = parameter.changed != nullptr;
        const double expected = difference(at, (table ? 2e-2 : 2e-3) * c.alpha);
        EXPECT_NE(expected, 0) << c.name << " " << parameter.name;
        EXPECT_NEAR(value[channel].d[2], expected,
                    (table ? 1e-2 : 1e-7) * (value[channel].v / c.alpha + std::fabs(expected)))
            << c.name << " " << parameter.name;
      }
    }
  }
}

// From behind, a BSDF around twosided reads the textures of the back.
TEST(Bsdf, NestedSidesHaveTheirOwnTextures) {
  const auto checkerboard = [] {
    TestProperties properties("texture", "checkerboard");
    return make_texture(properties);
  };
  const auto textured = [&] {
    TestProperties properties("bsdf", "diffuse");
    properties.textures["reflectance"] = checkerboard();
    return make_bsdf(properties);
  };
  for (const std::string type : {"mask", "blendbsdf", "normalmap"}) {
    TestProperties sides("bsdf", "twosided", {}, {textured(), textured()});
    std::vector<std::shared_ptr<Bsdf>> nested{make_bsdf(sides)};
    if (type == "blendbsdf") nested.insert(nested.begin(), textured());
    TestProperties properties("bsdf", type, {{"weight", 0.5}}, nested);
    if (type == "normalmap") properties.textures["normalmap"] = checkerboard();
    const auto original = make_bsdf(properties);
    for (const auto& bsdf : {original, original->clone()}) {
      // The map's own: its colour, the tangent and the outward normal.
      const Rgb<double> own[] = {{0.5, 0.5, 1}, {1, 0, 0}, {0, 0, 1}};
      std::vector<Rgb<double>> at;
      for (int k = 0; k < bsdf->texture_count(); ++k) {
        const std::string name = bsdf->texture_name(k);
        const bool is_back = name.find("back.") != std::string::npos;
        at.push_back(name == "normalmap" ? own[k] : Rgb<double>{1.0 - is_back, 1.0 * is_back, 0});
      }
      for (const bool front : {true, false}) {
        const Vec3d n{0, 0, front ? 1.0 : -1.0};
        const Rgb<double> f = bsdf->side(front)->eval(n, n, n, at.data());
        EXPECT_GT(front ? f.r : f.g, 0.1) << type << front;
        EXPECT_EQ(front ? f.g : f.r, 0) << type << front;
      }
    }
  }
}

TEST(Bsdf, CloneIsIndependent) {
  const auto inner = make_diffuse(Rgb<double>{0.5, 0.5, 0.5});
  TestProperties properties("bsdf", "twosided", {}, {inner});
  const auto original = make_bsdf(properties);
  const auto copy = original->clone();
  const std::vector<ParameterRef> parameters = copy->parameters();
  for (Dual* v : parameters[0].values) v->v = 0.25;
  const Vec3d n{0, 0, 1};
  EXPECT_DOUBLE_EQ(original->eval(n, n, n).r, 0.5 / kPi);
  EXPECT_DOUBLE_EQ(copy->eval(n, n, n).r, 0.25 / kPi);
  EXPECT_EQ(original->nested()[0], inner);
  EXPECT_NE(copy->nested()[0], inner);
}

TEST(Bsdf, TwoSidedHasTwoSides) {
  TestProperties single("bsdf", "twosided", {}, {make_diffuse(Rgb<double>{0.5, 0.5, 0.5})});
  const auto same = make_bsdf(single);
  EXPECT_EQ(same->side(true), same->side(false));
  EXPECT_EQ(same->parameters()[0].name, "reflectance");
  TestProperties pair("bsdf", "twosided", {},
                      {make_diffuse(Rgb<double>{0.5, 0.5, 0.5}), make_roughconductor({})});
  const auto both = make_bsdf(pair);
  EXPECT_EQ(both->side(true)->lobe().model, &kHemisphere);
  EXPECT_EQ(both->side(false)->lobe().model, &beckmann_lobe());
  EXPECT_EQ(both->parameters()[1].name, "back.alpha");
  EXPECT_EQ(make_diffuse(Rgb<double>{})->side(false), nullptr);
}

std::shared_ptr<Bsdf> read(const std::string& type,
                           std::map<std::string, TestProperties::Value> values = {}) {
  TestProperties properties("bsdf", type, std::move(values));
  return make_bsdf(properties);
}

TEST(Bsdf, DefaultsAreMitsubas) {
  EXPECT_EQ(read("diffuse")->describe(), "diffuse, reflectance 0.5 0.5 0.5");
  EXPECT_EQ(read("roughconductor")->describe(),
            "roughconductor, beckmann, alpha 0.1, eta 0 0 0, k 1 1 1");
  EXPECT_EQ(
      read("roughconductor", {{"material", "Au"}, {"alpha", 0.0}})->describe(),
      "roughconductor, beckmann, alpha 0.0001, eta 0.143036 0.375307 1.44205, k 3.983 2.38556 "
      "1.60336");
  EXPECT_EQ(read("roughconductor", {{"alpha_u", 0.3}, {"alpha_v", 0.3}, {"distribution", "ggx"}})
                ->lobe()
                .alpha,
            0.3);
}

TEST(Bsdf, NumbersTakeTheMeanOfColours) {
  const Rgb<double> colour{0.9, 0.3, 0.15};
  EXPECT_DOUBLE_EQ(read("roughconductor", {{"alpha", colour}})->lobe().alpha, 0.45);
  EXPECT_NE(read("principled", {{"metallic", colour}})->describe().find("0.45"), std::string::npos);
  TestProperties mask("bsdf", "mask", {{"opacity", colour}}, {make_diffuse(grey(0.5))});
  EXPECT_DOUBLE_EQ(make_bsdf(mask)->lobe().albedo, 0.45 * 0.5);
  TestProperties board("texture", "checkerboard", {{"color0", colour}, {"color1", 0.45}});
  const auto numbers = make_texture(board)->for_numbers();
  EXPECT_DOUBLE_EQ(numbers->range().least, numbers->range().most);
}

TEST(NormalMap, OfAConstantIsThatOfATexture) {
  const Rgb<double> t{0.6, 0.45, 0.95}, tangent{0.9, -1.3, 0.4}, outward{0.1, 0.2, 0.7};
  const auto make = [&](bool constant) {
    TestProperties texture("texture", "checkerboard");
    std::map<std::string, TestProperties::Value> values;
    if (constant) values["normalmap"] = t;
    TestProperties properties("bsdf", "normalmap", std::move(values),
                              {make_diffuse(Rgb<double>{0.2, 0.5, 0.9})});
    if (!constant) properties.textures["normalmap"] = make_texture(texture);
    return make_bsdf(properties);
  };
  const auto constant = make(true);
  const std::vector<ParameterRef> parameters = constant->parameters();
  ASSERT_EQ(parameters.back().name, "normalmap");
  EXPECT_EQ(parameters.back().values.size(), 3u);
  EXPECT_TRUE(parameters.back().mixes_channels);
  EXPECT_TRUE(constant->is_constant());
  parameters.back().values[1]->d[0] = 1;
  EXPECT_FALSE(constant->is_constant());
  const test::HeldTextures held(make(false), {t, tangent, outward});
  const test::HeldTextures of_constant(constant, {tangent, outward});
  Rng rng(1, 2, 3);
  for (int i = 0; i < 100; ++i) {
    const Vec3d n = random_direction(rng), wi = random_direction(rng), wo = random_direction(rng);
    const Rgb<double> a = held.eval(n, wi, wo, nullptr), b = of_constant.eval(n, wi, wo, nullptr);
    EXPECT_EQ(a.r, b.r);
    EXPECT_EQ(a.b, b.b);
  }
}

// Around a BSDF of two sides the map bends the normal of the front; the back has the opposite one.
TEST(MappedNormals, AroundTwoSidesTurnOver) {
  const Rgb<double> tangent{0.9, -1.3, 0.4}, outward{0.1, 0.2, 0.7};
  const auto make = [&](const std::string& type, bool two_sided) {
    std::shared_ptr<Bsdf> inside = make_diffuse(Rgb<double>{0.2, 0.5, 0.9});
    if (two_sided) {
      TestProperties sides("bsdf", "twosided", {}, {inside});
      inside = make_bsdf(sides);
    }
    TestProperties properties("bsdf", type, {}, {inside});
    TestProperties texture("texture", "checkerboard");
    properties.textures["normalmap"] = make_texture(texture);
    return make_bsdf(properties);
  };
  const std::vector<Rgb<double>> normal_map{{0.6, 0.45, 0.95}, tangent, outward};
  const std::vector<Rgb<double>> bump_map{{0.3, -0.2, 0.1}, outward};
  for (const bool bumps : {false, true}) {
    const std::string type = bumps ? "bumpmap" : "normalmap";
    const auto one = make(type, false), two = make(type, true);
    EXPECT_EQ(one->side(false), nullptr);
    ASSERT_NE(two->side(false), nullptr);
    EXPECT_EQ(two->parameters().size(), one->parameters().size());
    const Rgb<double>* at = (bumps ? bump_map : normal_map).data();
    Rng rng(1, 2, 3);
    int seen = 0;
    for (int i = 0; i < 200; ++i) {
      const Vec3d n = random_direction(rng), wi = random_direction(rng), wo = random_direction(rng);
      if (!(dot(n, Vec3d{outward.r, outward.g, outward.b}) > 0)) continue;
      const double expected = one->eval(n, wi, wo, at).g;
      EXPECT_EQ(two->eval(n, wi, wo, at).g, expected);
      EXPECT_NEAR(two->side(false)->eval(-n, -wi, -wo, at).g, expected, 1e-14);
      EXPECT_EQ(two->side(false)->pdf_solid_angle(-n, -wi, -wo, at),
                one->pdf_solid_angle(n, wi, wo, at));
      seen += expected > 0;
    }
    EXPECT_GT(seen, 10);
  }
}

void expect_error(const std::string& part, const std::string& type,
                  std::map<std::string, TestProperties::Value> values) {
  try {
    read(type, std::move(values));
    FAIL() << "no error: " << part;
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find(part), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("test.xml:3:5: error: "), std::string::npos) << e.what();
  }
}

TEST(Bsdf, BadInputIsExplained) {
  expect_error("unknown bsdf type \"glass\" (known: ", "glass", {});
  expect_error("a reflectance must lie in [0, 1]", "diffuse", {{"reflectance", 1.5}});
  expect_error("the roughness must not be negative", "roughconductor", {{"alpha", -0.1}});
  expect_error("unknown distribution \"phong\" (known: beckmann, ggx)", "roughconductor",
               {{"distribution", "phong"}});
  expect_error("alpha_u must equal alpha_v", "roughplastic", {{"alpha_u", 0.1}, {"alpha_v", 0.2}});
  expect_error("alpha_u and alpha_v come together", "roughconductor", {{"alpha_v", 0.2}});
  expect_error("either alpha or alpha_u, alpha_v", "roughconductor",
               {{"alpha", 0.1}, {"alpha_u", 0.1}, {"alpha_v", 0.1}});
  expect_error("not both", "roughconductor", {{"material", "Cu"}, {"eta", 1.0}});
  expect_error("unknown material \"Cheese\" (known: none, a-C, Ag, Al,", "roughconductor",
               {{"material", "Cheese"}});
  expect_error("eta and k are both 0", "roughconductor", {{"k", 0.0}});
  expect_error("it must lie in [0.1, 10]", "roughplastic", {{"int_ior", 20.0}});
  expect_error("twosided needs one or two nested bsdfs, not 0", "twosided", {});
  expect_error("a normalmap needs a texture \"normalmap\"", "normalmap", {});
  expect_error("bumpmap needs one nested texture", "bumpmap", {});
  expect_error("must lie in [0, 1]", "principled", {{"metallic", 1.5}});
  expect_error("give either eta or specular", "principled", {{"eta", 1.5}, {"specular", 0.5}});
  expect_error("must lie in [0, 2]", "principledthin", {{"diff_trans", 3.0}});
}

}  // namespace
}  // namespace limn
