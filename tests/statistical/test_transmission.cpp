// Rough lobes on both sides of a surface: densities against samples, energy, reciprocity, slopes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "limn/core/make_bsdf.h"
#include "limn/core/rng.h"
#include "support/bsdf_cases.h"
#include "support/chi_square.h"
#include "support/quadrature.h"
#include "support/test_properties.h"

namespace limn {
namespace {

using test::around;
using test::TestProperties;

const Vec3d kNormal = normalize(Vec3d{0.3, -0.5, 0.6});
constexpr double kPolarAngles[] = {0.0, 0.5, 0.9, 1.3};
constexpr int kRings = 16, kSectors = 12;

struct Side {
  std::string name;
  std::shared_ptr<Bsdf> bsdf;
  bool front;
  bool reciprocal = true;
  const Bsdf& of() const { return *bsdf->side(front); }
};

std::shared_ptr<Bsdf> make(const std::string& type,
                           const std::map<std::string, TestProperties::Value>& values,
                           const std::vector<std::shared_ptr<Bsdf>>& nested = {}) {
  TestProperties properties("bsdf", type, values, nested);
  return make_bsdf(properties);
}

std::vector<Side> sides() {
  std::vector<Side> all;
  const auto add = [&](const std::string& name, const std::shared_ptr<Bsdf>& bsdf) {
    all.push_back({name + " front", bsdf, true});
    all.push_back({name + " back", bsdf, false});
  };
  for (const std::string distribution : {"ggx", "beckmann"}) {
    add(distribution, make("roughdielectric", {{"alpha", 0.4}, {"distribution", distribution}}));
  }
  const auto bubble =
      make("roughdielectric",
           {{"alpha", 0.3}, {"int_ior", 1.0}, {"ext_ior", 1.4}, {"specular_transmittance", 0.5}});
  add("bubble", bubble);
  add("mask", make("mask", {{"opacity", 0.7}}, {bubble}));
  add("blend", make("blendbsdf", {{"weight", 0.3}}, {bubble, make_diffuse(grey(0.5))}));
  // Values: the tangent; the colour, the tangent and the side that is outward, and the gradient of
  // heights and the outward normal, of maps that tilt normals by a third.
  const auto hold = [](const std::shared_ptr<Bsdf>& bsdf, const std::vector<Rgb<double>>& values) {
    return std::make_shared<test::HeldTextures>(bsdf, values);
  };
  add("anisotropic",
      hold(make("roughdielectric", {{"alpha_u", 0.5}, {"alpha_v", 0.25}}), {{0.9, -1.3, 0.4}}));
  const auto glass = make("roughdielectric", {{"alpha", 0.3}, {"distribution", "ggx"}});
  const size_t mapped = all.size();
  const Rgb<double> out{kNormal.x, kNormal.y, kNormal.z};
  for (const char* type : {"normalmap", "bumpmap"}) {
    TestProperties texture("texture", "checkerboard"), map("bsdf", type, {}, {glass});
    map.textures["normalmap"] = make_texture(texture);
    const bool bump = std::string(type) == "bumpmap";
    add(type, hold(make_bsdf(map), bump ? std::vector{Rgb<double>{0.3, 0.1, -0.1}, out}
                                        : std::vector{Rgb<double>{0.6, 0.4, 0.9},
                                                      Rgb<double>{0.9, -1.3, 0.4}, out}));
  }
  for (size_t i = mapped; i < all.size(); ++i) all[i].reciprocal = false;
  all.push_back({"plastic", make("plastic", {}), true});
  return all;
}

Vec3d direction(double cosine, double phi) {
  return around(kNormal, std::acos(std::clamp(cosine, -1.0, 1.0)), phi);
}

// The integral of f over each bin of the sphere of directions.
std::vector<double> integrate_bins(const std::function<double(const Vec3d&)>& f) {
  std::vector<double> bins;
  for (int ring = 0; ring < kRings; ++ring) {
    for (int sector = 0; sector < kSectors; ++sector) {
      const double low = -1 + 2.0 * ring / kRings, left = 2 * kPi * sector / kSectors;
      const auto over_phi = [&](double cosine) {
        return test::integrate([&](double phi) { return f(direction(cosine, phi)); }, left,
                               left + 2 * kPi / kSectors, 4);
      };
      bins.push_back(test::integrate(over_phi, low, low + 2.0 / kRings, 8));
    }
  }
  return bins;
}

double total(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x;
  return sum;
}

TEST(Transmission, SamplesMatchTheirDensity) {
  constexpr int kSamples = 100000;
  const std::vector<Side> all = sides();
  const double threshold =
      test::sidak_threshold(0.01, static_cast<int>(all.size() * std::size(kPolarAngles)));
  const Frame frame(kNormal);
  for (const Side& side : all) {
    for (const double polar : kPolarAngles) {
      const Vec3d wi = around(kNormal, polar, 0.7);
      std::vector<double> expected = integrate_bins(
          [&](const Vec3d& wo) { return side.of().pdf_solid_angle(kNormal, wi, wo); });
      expected.push_back(std::max(0.0, 1 - total(expected)));
      for (double& e : expected) e *= kSamples;
      std::vector<double> observed(expected.size(), 0);
      Rng rng(1, 2, 3);
      for (int i = 0; i < kSamples; ++i) {
        const double u1 = rng.uniform();
        const auto wo = side.of().sample(kNormal, wi, u1, rng.uniform());
        size_t bin = observed.size() - 1;
        if (wo) {
          const Vec3d local = frame.to_local(*wo);
          const double phi = std::atan2(local.y, local.x) + (local.y < 0 ? 2 * kPi : 0);
          const int ring = std::clamp(static_cast<int>((local.z + 1) / 2 * kRings), 0, kRings - 1);
          const int sector =
              std::clamp(static_cast<int>(phi / (2 * kPi) * kSectors), 0, kSectors - 1);
          bin = static_cast<size_t>(ring * kSectors + sector);
        }
        ++observed[bin];
      }
      const test::ChiSquare result = test::chi_square_test(observed, expected);
      EXPECT_GT(result.p_value, threshold)
          << side.name << " at " << polar << ": chi-square " << result.statistic << " with "
          << result.degrees_of_freedom << " degrees of freedom";
    }
  }
}

// Light that passes is counted without the factor by which refraction scales radiance.
TEST(Transmission, EnergyIsBoundedAndAgreesWithQuadrature) {
  constexpr int kSamples = 40000;
  for (const Side& side : sides()) {
    const double eta = side.of().eta();
    for (const double polar : kPolarAngles) {
      const Vec3d wi = around(kNormal, polar, 0.7);
      const auto energy = [&](const Vec3d& wo) {
        const double scale = dot(kNormal, wo) < 0 ? eta * eta : 1;
        return scale * side.of().eval(kNormal, wi, wo).g;
      };
      const double exact = total(integrate_bins(energy));
      double sum = 0, squares = 0;
      Rng rng(5, 6, 7);
      for (int i = 0; i < kSamples; ++i) {
        const double u1 = rng.uniform();
        const auto wo = side.of().sample(kNormal, wi, u1, rng.uniform());
        if (!wo) continue;
        const double weight = energy(*wo) / side.of().pdf_solid_angle(kNormal, wi, *wo);
        sum += weight;
        squares += weight * weight;
      }
      const double mean = sum / kSamples;
      const double error = std::sqrt(std::max(0.0, squares / kSamples - mean * mean) / kSamples);
      EXPECT_NEAR(mean, exact, 4.5 * error + 1e-3) << side.name << " at " << polar;
      EXPECT_LE(exact, 1.003) << side.name << " at " << polar;
    }
  }
}

// Masking takes energy of the order of the square of alpha, so nearly smooth glass keeps it all.
TEST(Transmission, NearlySmoothGlassKeepsAllEnergy) {
  const auto glass = make("roughdielectric", {{"alpha", 1e-3}, {"distribution", "ggx"}});
  constexpr int kSamples = 400000;
  for (const double polar : {0.0, 0.5, 0.9}) {
    const Vec3d wi = around(kNormal, polar, 0.7);
    const Bsdf& front = *glass->side(true);
    double sum = 0, squares = 0;
    Rng rng(8, 6, 7);
    for (int i = 0; i < kSamples; ++i) {
      const double u1 = rng.uniform();
      const auto wo = front.sample(kNormal, wi, u1, rng.uniform());
      if (!wo) continue;
      const double scale = dot(kNormal, *wo) < 0 ? front.eta() * front.eta() : 1;
      const double weight =
          scale * front.eval(kNormal, wi, *wo).g / front.pdf_solid_angle(kNormal, wi, *wo);
      sum += weight;
      squares += weight * weight;
    }
    // Fresnel's two parts add up to 1 on every facet; what is left of 1 is masking's, about 1e-6.
    const double mean = sum / kSamples;
    const double error = std::sqrt((squares / kSamples - mean * mean) / kSamples);
    EXPECT_NEAR(mean, 1, 4.5 * error + 1e-5) << polar;
  }
}

// f(wi, wo) cos_i eta_o^2 = f(wo, wi) cos_o eta_i^2 with f over the cosine, between the two sides.
// A facet reflects or passes about as much as it is drawn to, so that paths within glass keep their
// weight: 0.1 against 0.1125, the most that rounds to it, and a Beckmann lobe's fitted masking.
TEST(Transmission, NoSampleOfGlassWeighsMoreThanItsPart) {
  std::vector<std::shared_ptr<Bsdf>> glass{
      make("principled", {{"spec_trans", 1.0}, {"roughness", 0.6}, {"base_color", 1.0}})};
  for (const std::string distribution : {"ggx", "beckmann"}) {
    glass.push_back(make("roughdielectric", {{"alpha", 0.4}, {"distribution", distribution}}));
  }
  Rng rng(2, 4, 6);
  for (const auto& bsdf : glass) {
    for (const bool front : {true, false}) {
      const Bsdf& of = *bsdf->side(front);
      double most = 0;
      for (int i = 0; i < 20000; ++i) {
        const Vec3d wi = around(kNormal, 1.5 * rng.uniform(), 6 * rng.uniform());
        const double u1 = rng.uniform();
        const auto wo = of.sample(kNormal, wi, u1, rng.uniform());
        if (!wo) continue;
        const bool passes = dot(kNormal, *wo) < 0;
        const BsdfValue f = of.eval_with_pdf(kNormal, wi, *wo);
        most = std::max(most, f.value.g / f.pdf * (passes ? std::pow(of.eta(), 2) : 1));
      }
      EXPECT_LT(most, 1.14) << bsdf->describe() << front;
    }
  }
}

TEST(Transmission, IsReciprocal) {
  for (const Side& side : sides()) {
    if (!side.of().lobes().below || !side.reciprocal) continue;
    Rng rng(1, 1, 1);
    const double eta = side.of().eta();
    for (int i = 0; i < 50; ++i) {
      const Vec3d wi = around(kNormal, 1.2 * rng.uniform(), 0.7);
      const double u1 = rng.uniform();
      const auto wo = side.of().sample(kNormal, wi, u1, rng.uniform());
      if (!wo || dot(kNormal, *wo) > 0) continue;
      const Bsdf& other = *side.bsdf->side(!side.front);
      const double there = side.of().eval(kNormal, wi, *wo).g / std::fabs(dot(kNormal, *wo));
      const double back = other.eval(-kNormal, *wo, wi).g / std::fabs(dot(kNormal, wi));
      EXPECT_NEAR(there * eta * eta / back, 1, 1e-9) << side.name;
    }
  }
}

double difference(const std::function<double(double)>& f, double h) {
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

template <class S>
Vec3<S> turning(const Vec3d& v, const Vec3d& velocity, const S& t) {
  return normalize(v + velocity * t);
}

Vec3<Dual> still(const Vec3d& v) { return {v.x, v.y, v.z}; }

TEST(Transmission, DerivativesMatchDifferences) {
  const Vec3d a{0.3, -0.5, 0.2}, b{-0.4, 0.1, 0.6}, e{0.7, 0.2, -0.3};
  const auto lane = [](int k) {
    Lanes l;
    l[k] = 1;
    return Dual(0, l);
  };
  for (const Side& side : sides()) {
    Rng rng(2, 2, 2);
    for (int i = 0; i < 20; ++i) {
      const Vec3d n = kNormal, wi = around(n, 1.1 * rng.uniform(), 0.7);
      const double u1 = rng.uniform();
      const auto drawn = side.of().sample(n, wi, u1, rng.uniform());
      if (!drawn || std::fabs(dot(n, *drawn)) < 0.2) continue;
      const Vec3d wo = *drawn;
      const Rgb<Dual> f =
          side.of().eval(turning(n, a, lane(0)), turning(wi, b, lane(1)), turning(wo, e, lane(2)));
      const std::function<double(double)> moved[3] = {
          [&](double t) { return side.of().eval(turning(n, a, t), wi, wo).g; },
          [&](double t) { return side.of().eval(n, turning(wi, b, t), wo).g; },
          [&](double t) { return side.of().eval(n, wi, turning(wo, e, t)).g; }};
      for (int k = 0; k < 3; ++k) {
        const double expected = difference(moved[k], 5e-4);
        EXPECT_NEAR(f.g.d[k], expected, 1e-5 * (f.g.v + std::fabs(expected)))
            << side.name << " lane " << k;
      }
    }
  }
}

// True if slopes to both sides differ: the facet is near its critical angle.
bool is_kinked(const std::function<double(double)>& f, double step) {
  const double left = f(0) - f(-step), right = f(step) - f(0);
  return std::fabs(right - left) > 0.5 * std::max(std::fabs(left), std::fabs(right));
}

TEST(Transmission, DerivativesOfParametersMatchDifferences) {
  int kinks = 0;
  for (const Side& side : sides()) {
    const auto moved = side.bsdf->clone();
    const Bsdf& of = *moved->side(side.front);
    for (const ParameterRef& parameter : moved->parameters()) {
      const double offset = parameter.values[0]->v == parameter.most ? -0.01 : 0;
      for (Dual* v : parameter.values) v->v += offset;
      Rng rng(3, 3, 3);
      for (int i = 0; i < 10; ++i) {
        const Vec3d n = kNormal, wi = around(n, rng.uniform(), 0.7);
        const double u1 = rng.uniform();
        const auto wo = of.sample(n, wi, u1, rng.uniform());
        if (!wo) continue;
        for (Dual* v : parameter.values) v->d[1] = 1;
        const Rgb<Dual> f = of.eval(still(n), still(wi), still(*wo));
        for (Dual* v : parameter.values) v->d[1] = 0;
        const auto at = [&](double t) {
          for (Dual* v : parameter.values) v->v += t;
          const double value = of.eval(n, wi, *wo).g;
          for (Dual* v : parameter.values) v->v -= t;
          return value;
        };
        if (is_kinked(at, 1e-3)) {
          ++kinks;
          continue;
        }
        const double expected = difference(at, 5e-4);
        EXPECT_NEAR(f.g.d[1], expected, 1e-5 * (f.g.v + std::fabs(expected)))
            << side.name << " " << parameter.name;
      }
      for (Dual* v : parameter.values) v->v -= offset;
    }
  }
  EXPECT_LE(kinks, 3);
}

}  // namespace
}  // namespace limn
