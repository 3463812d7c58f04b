// Smooth lobes: where their rays go, what they weigh, and how paths choose among them.
#include <gtest/gtest.h>

#include <functional>

#include "limn/core/make_bsdf.h"
#include "limn/core/rng.h"
#include "src/bsdf/fresnel.h"
#include "src/bsdf/rough_boundary.h"
#include "support/bsdf_cases.h"
#include "support/running_mean.h"
#include "support/test_properties.h"

namespace limn {
namespace {

using test::around;
using test::TestProperties;

const Vec3d kNormal = normalize(Vec3d{0.3, -0.5, 0.6});
constexpr double kPolarAngles[] = {0.0, 0.3, 0.7, 1.2, 1.55};

std::shared_ptr<Bsdf> make(const std::string& type,
                           const std::map<std::string, TestProperties::Value>& values = {},
                           const std::vector<std::shared_ptr<Bsdf>>& nested = {}) {
  TestProperties properties("bsdf", type, values, nested);
  return make_bsdf(properties);
}

struct SmoothCase {
  std::string name;
  std::shared_ptr<Bsdf> bsdf;
  bool loses_nothing;  // the rays have all light
};

std::vector<SmoothCase> smooth_cases() {
  const auto half = make_diffuse(grey(0.5));
  return {
      {"conductor", make("conductor"), true},
      {"copper", make("conductor", {{"material", "Cu"}}), false},
      {"glass", make("dielectric"), true},
      {"water", make("dielectric", {{"int_ior", "water"}}), true},
      {"bubble", make("dielectric", {{"int_ior", 1.0}, {"ext_ior", "diamond"}}), true},
      {"coloured glass",
       make("dielectric", {{"specular_reflectance", Rgb<double>{0.8, 0.9, 0.4}},
                           {"specular_transmittance", Rgb<double>{0.3, 0.7, 0.6}}}),
       false},
      {"pane", make("thindielectric"), true},
      {"plastic", make("plastic"), false},
      {"nonlinear plastic", make("plastic", {{"nonlinear", true}}), false},
      {"mask", make("mask", {{"opacity", 0.3}}, {half}), false},
      {"mask of glass", make("mask", {{"opacity", 0.3}}, {make("dielectric")}), true},
      {"null", make("null"), true},
      {"blend", make("blendbsdf", {{"weight", 0.3}}, {half, make("dielectric")}), false},
      {"blend of mirrors", make("blendbsdf", {{"weight", 0.3}}, {make("conductor"), make("null")}),
       true},
  };
}

// visit(name, BSDF of a side, wi) for all cases, sides and angles.
void for_every_side(
    const std::function<void(const SmoothCase&, bool, const Bsdf&, const Vec3d&)>& visit) {
  for (const SmoothCase& c : smooth_cases()) {
    for (const bool front : {true, false}) {
      const Bsdf* const side = c.bsdf->side(front);
      if (!side || !side->lobes().smooth) continue;
      for (const double polar : kPolarAngles) visit(c, front, *side, around(kNormal, polar, 0.7));
    }
  }
}

TEST(SmoothLobes, LoseNoLight) {
  for_every_side([](const SmoothCase& c, bool front, const Bsdf& bsdf, const Vec3d& wi) {
    SmoothRays<double> rays;
    const int count = bsdf.smooth_rays(kNormal, wi, rays);
    double sum = 0;
    for (int k = 0; k < count; ++k) {
      EXPECT_NEAR(length(rays[k].wo), 1, 1e-14) << c.name;
      EXPECT_EQ(rays[k].total, is_black(rays[k].weight) && rays[k].total) << c.name;
      sum += rays[k].weight.g * (rays[k].eta * rays[k].eta);
    }
    if (c.loses_nothing && (front || c.name != "blend of mirrors")) {
      EXPECT_NEAR(sum, 1, 1e-14) << c.name << " at " << dot(kNormal, wi);
    } else {
      EXPECT_LT(sum, 1) << c.name;
    }
  });
}

TEST(SmoothLobes, MirrorAndRefract) {
  for (const bool front : {true, false}) {
    const auto glass = make("dielectric", {{"int_ior", 1.5}, {"ext_ior", 1.0}});
    const double eta = front ? 1.5 : 1 / 1.5;
    for (const double polar : kPolarAngles) {
      const Vec3d wi = around(kNormal, polar, 0.7);
      SmoothRays<double> rays;
      ASSERT_EQ(glass->side(front)->smooth_rays(kNormal, wi, rays), 2);
      EXPECT_LT(length(rays[0].wo - around(kNormal, polar, 0.7 + kPi)), 1e-14);
      const double sine = std::sin(polar) / eta;
      EXPECT_EQ(rays[1].total, sine > 1);
      if (sine > 1) continue;
      EXPECT_LT(length(rays[1].wo - around(-kNormal, std::asin(sine), 0)), 2) << polar;
      EXPECT_NEAR(dot(rays[1].wo, kNormal), -std::sqrt(1 - sine * sine), 1e-14);
      EXPECT_NEAR(dot(rays[1].wo, cross(kNormal, wi)), 0, 1e-14);
      EXPECT_LE(dot(rays[1].wo - kNormal * dot(rays[1].wo, kNormal), wi), 1e-14);
      EXPECT_DOUBLE_EQ(rays[1].eta, eta);
    }
  }
}

// The same light passes both ways, but for the squares of the indices.
TEST(SmoothLobes, AreReciprocal) {
  const auto glass = make("dielectric", {{"specular_transmittance", 0.7}});
  for (const double polar : kPolarAngles) {
    const Vec3d wi = around(kNormal, polar, 0.7);
    SmoothRays<double> there, back;
    glass->side(true)->smooth_rays(kNormal, wi, there);
    glass->side(false)->smooth_rays(-kNormal, there[1].wo, back);
    EXPECT_LT(length(back[1].wo - wi), 1e-13);
    EXPECT_NEAR(there[1].weight.r * std::pow(there[1].eta, 2),
                back[1].weight.r * std::pow(back[1].eta, 2), 1e-13);
  }
}

TEST(SmoothLobes, SharesAreProbabilities) {
  using By = SmoothShares::By;
  for_every_side([](const SmoothCase& c, bool, const Bsdf& bsdf, const Vec3d& wi) {
    SmoothRays<double> rays;
    const int count = bsdf.smooth_rays(kNormal, wi, rays);
    for (const By by : {By::kWeight, By::kSlope, By::kSteps}) {
      const SmoothShares shares = smooth_shares(bsdf, kNormal, wi, nullptr, by);
      ASSERT_EQ(shares.count, count);
      double sum = shares.rough;
      for (int k = 0; k < count; ++k) {
        sum += shares.ray[k];
        if (by == By::kWeight) {
          EXPECT_EQ(shares.ray[k] > 0, !is_black(rays[k].weight)) << c.name;
        } else if (by == By::kSlope && !rays[k].total) {
          EXPECT_GE(shares.ray[k], 0.1) << c.name;
        } else if (by == By::kSteps) {
          EXPECT_EQ(shares.ray[k] > 0, !rays[k].total) << c.name;
        }
      }
      EXPECT_NEAR(sum, 1, 1e-14) << c.name;
      EXPECT_EQ(shares.rough > 0, bsdf.is_rough() && (by != By::kWeight || shares.rough > 0))
          << c.name;
    }
  });
}

// Where a path takes rays by shares in steps, the mean square of its weight is at most 1.5 times
// its squared mean. With equal shares it would be twice that where nearly all light goes one way.
TEST(SmoothLobes, SharesInStepsKeepWeightsEven) {
  for_every_side([](const SmoothCase& c, bool, const Bsdf& bsdf, const Vec3d& wi) {
    if (bsdf.is_rough()) return;
    SmoothRays<double> rays;
    const int count = bsdf.smooth_rays(kNormal, wi, rays);
    const SmoothShares shares = smooth_shares(bsdf, kNormal, wi, nullptr, SmoothShares::By::kSteps);
    double sum = 0, square = 0;
    for (int k = 0; k < count; ++k) {
      const double weight = max_channel(rays[k].weight) * (rays[k].eta * rays[k].eta);
      sum += weight;
      if (shares.ray[k] > 0) square += weight * weight / shares.ray[k];
    }
    EXPECT_LE(square, 1.5 * sum * sum) << c.name;
  });
}

double difference(const std::function<double(double)>& f, double h) {
  return (8 * (f(h) - f(-h)) - (f(2 * h) - f(-2 * h))) / (12 * h);
}

// Direction and weight of a ray, one after the other.
template <class S>
S number(const SmoothRay<S>& ray, int i) {
  return i < 3 ? ray.wo[i] : ray.weight[i - 3];
}

template <class S>
Vec3<S> turning(const Vec3d& v, const Vec3d& velocity, const S& t) {
  return normalize(v + velocity * t);
}

TEST(SmoothLobes, DerivativesMatchDifferences) {
  const Vec3d a{0.3, -0.5, 0.2}, b{-0.4, 0.1, 0.6};
  for_every_side([&](const SmoothCase& c, bool front, const Bsdf& bsdf, const Vec3d& wi) {
    if (dot(kNormal, wi) < 0.1) return;  // slopes grow at the horizon
    SmoothRays<Dual> rays;
    Lanes first, second;
    first[0] = second[1] = 1;
    const int count = bsdf.smooth_rays(turning(kNormal, a, Dual(0, first)),
                                       turning(wi, b, Dual(0, second)), rays);
    const auto at = [&](double s, double t, int k, int i) {
      SmoothRays<double> moved;
      bsdf.smooth_rays(turning(kNormal, a, s), turning(wi, b, t), moved);
      return number(moved[k], i);
    };
    for (int k = 0; k < count; ++k) {
      if (rays[k].total) continue;
      for (int i = 0; i < 6; ++i) {
        EXPECT_NEAR(number(rays[k], i).d[0],
                    difference([&](double t) { return at(t, 0, k, i); }, 1e-3), 1e-7)
            << c.name << (front ? " front " : " back ") << k << " " << i;
        EXPECT_NEAR(number(rays[k], i).d[1],
                    difference([&](double t) { return at(0, t, k, i); }, 1e-3), 1e-7)
            << c.name << (front ? " front " : " back ") << k << " " << i;
      }
    }
  });
}

TEST(SmoothLobes, DerivativesOfParametersMatchDifferences) {
  for (const SmoothCase& c : smooth_cases()) {
    const auto moved = c.bsdf->clone();
    for (const ParameterRef& parameter : moved->parameters()) {
      const double offset = parameter.values[0]->v == parameter.most ? -0.01 : 0.01;
      for (Dual* v : parameter.values) v->v += offset;
      for (const bool front : {true, false}) {
        const Bsdf* const side = moved->side(front);
        if (!side || !side->lobes().smooth) continue;
        const Vec3d n = kNormal, wi = around(n, 0.5, 0.7);
        for (Dual* v : parameter.values) v->d[2] = 1;
        SmoothRays<Dual> rays;
        const int count =
            side->smooth_rays(Vec3<Dual>{n.x, n.y, n.z}, Vec3<Dual>{wi.x, wi.y, wi.z}, rays);
        for (Dual* v : parameter.values) v->d[2] = 0;
        for (int k = 0; k < count; ++k) {
          if (rays[k].total) continue;
          for (int i = 0; i < 6; ++i) {
            const auto at = [&](double t) {
              for (Dual* v : parameter.values) v->v += t;
              SmoothRays<double> of;
              side->smooth_rays(n, wi, of);
              for (Dual* v : parameter.values) v->v -= t;
              return number(of[k], i);
            };
            EXPECT_NEAR(number(rays[k], i).d[2], difference(at, 1e-3), 1e-8)
                << c.name << " " << parameter.name << (front ? " front " : " back ") << k;
          }
        }
      }
      for (Dual* v : parameter.values) v->v -= offset;
    }
  }
}

// A copy's back is that of the copy.
TEST(SmoothLobes, ClonesHaveSidesOfTheirOwn) {
  for (const SmoothCase& c : smooth_cases()) {
    const auto copy = c.bsdf->clone();
    for (const ParameterRef& p : copy->parameters()) {
      for (Dual* v : p.values) v->v = 0.5 * (v->v + std::min(p.most, 2.0));
    }
    for (const bool front : {true, false}) {
      const Bsdf* const side = c.bsdf->side(front);
      ASSERT_EQ(side == nullptr, copy->side(front) == nullptr) << c.name;
      if (!side || !side->lobes().smooth || copy->parameters().empty()) continue;
      const Vec3d wi = around(kNormal, 0.6, 1);
      SmoothRays<double> of, of_copy, of_clone_of_side;
      const int count = side->smooth_rays(kNormal, wi, of);
      copy->side(front)->smooth_rays(kNormal, wi, of_copy);
      copy->side(front)->clone()->smooth_rays(kNormal, wi, of_clone_of_side);
      bool differs = false;
      for (int k = 0; k < count; ++k) {
        for (int i = 0; i < 6; ++i) {
          differs |= number(of[k], i) != number(of_copy[k], i);
          EXPECT_EQ(number(of_copy[k], i), number(of_clone_of_side[k], i)) << c.name;
        }
      }
      EXPECT_TRUE(differs || c.name == "null" || c.name == "conductor") << c.name;
    }
  }
}

// The light that a rough plastic's base reflects over that of a smooth one's, as alpha goes to 0:
// Mitsuba has the inner reflectance as a sum for one, as a fit for the other.
double ratio_of_bases(double rho, double eta) {
  constexpr int kCosines = 64;
  double sum = 0;
  for (int i = 0; i < kCosines; ++i) {
    const double z = i / (kCosines - 1.0);
    sum += fresnel_dielectric<double>(z, 1 / eta).reflected * z * 2 / kCosines;
  }
  return (1 - rho * inner_diffuse_reflectance(eta)) / (1 - rho * sum);
}

// What the rough part reflects of light along wi, in green.
double rough_albedo(const Bsdf& bsdf, const Vec3d& wi) {
  constexpr int kSteps = 4000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) {
    const double cos_o = (i + 0.5) / kSteps;
    sum += bsdf.eval_with_pdf(kNormal, wi, around(kNormal, std::acos(cos_o), 2)).value.g;
  }
  return sum * 2 * kPi / kSteps;
}

// Made rough, they reflect and refract as much in the limit, but for that ratio.
TEST(SmoothLobes, AreLimitsOfRoughOnes) {
  constexpr double kAlpha = 1e-4, kEta = 1.5, kRho = 0.6;
  // The mean square of the normals' slopes, about: what they change is of second order.
  const double slopes = -kAlpha * kAlpha * std::log(kAlpha);
  const std::map<std::string, TestProperties::Value> glass{{"int_ior", kEta}, {"ext_ior", 1.0}};
  auto coat = glass;
  coat["diffuse_reflectance"] = kRho;
  coat["specular_reflectance"] = 0.7;
  auto nonlinear = coat;
  nonlinear["nonlinear"] = true;
  struct Case {
    std::string type;
    std::map<std::string, TestProperties::Value> values;
    double base;  // of the rough one's rough part over that of the smooth one
  };
  Rng rng(5, 0, 0);
  for (const Case& c : {Case{"conductor", {{"material", "Cu"}}, 1}, Case{"dielectric", glass, 1},
                        Case{"plastic", coat, ratio_of_bases(1, kEta)},
                        Case{"plastic", nonlinear, ratio_of_bases(kRho, kEta)}}) {
    TestProperties properties("bsdf", c.type, c.values);
    const auto smooth = make_bsdf(properties);
    properties.roughness = kAlpha;
    const auto rough = make_bsdf(properties);
    ASSERT_FALSE(rough->side(true)->lobes().smooth) << c.type;
    for (const double polar : {0.1, 0.7, 1.2}) {
      const Vec3d wi = around(kNormal, polar, 0.7);
      double exact = smooth->is_rough() ? c.base * rough_albedo(*smooth->side(true), wi) : 0;
      SmoothRays<double> rays;
      const int count = smooth->side(true)->smooth_rays(kNormal, wi, rays);
      for (int k = 0; k < count; ++k) exact += rays[k].weight.g;
      RunningMean mean;
      for (int s = 0; s < 20000; ++s) {
        const double u = rng.uniform(), v = rng.uniform();
        const auto wo = rough->side(true)->sample(kNormal, wi, u, v);
        if (!wo) {
          mean.add(0);
          continue;
        }
        const BsdfValue at = rough->side(true)->eval_with_pdf(kNormal, wi, *wo);
        mean.add(at.pdf > 0 ? at.value.g / at.pdf : 0);
      }
      EXPECT_LT(std::fabs(mean.mean() - exact), 4.5 * mean.standard_error() + slopes)
          << c.type << " at " << polar << ": " << mean.mean() << " +- " << mean.standard_error()
          << ", " << exact;
    }
  }
}

// The inside of a nearly smooth boundary: of diffuse light it reflects, by the index, what a smooth
// one does. Sums over cosines 1/63 apart resolve the critical angle to that: so far may slopes be.
TEST(RoughBoundary, InnerReflectanceOfSmoothOnesHasTheSlopeOfFresnels) {
  const auto exact = [](double eta) {
    constexpr int kNodes = 20000;
    double sum = 0;
    for (int i = 0; i < kNodes; ++i) {
      const double c = (i + 0.5) / kNodes;
      sum += fresnel_dielectric<double>(c, 1 / eta).reflected * 2 * c / kNodes;
    }
    return sum;
  };
  for (const double eta : {1.3, 1.49, 1.7, 1.9, 2.0, 2.4}) {
    const RoughBoundary boundary(microfacet::Distribution::kBeckmann, 1e-3, eta);
    const double slope = boundary.inner_reflectance(Dual(1e-3), Dual(eta, {1, 0, 0, 0})).d.lane[0];
    const double expected = (exact(eta + 0.01) - exact(eta - 0.01)) / 0.02;
    EXPECT_NEAR(slope / expected, 1, 2.0 / 63) << eta;
  }
}

// The critical angle crosses nodes of a quadrature as roughness and index move: differences over
// small steps are slopes all the same, to the resolution of the cosines.
TEST(RoughBoundary, InnerReflectanceMovesWithoutSteps) {
  using microfacet::Distribution;
  constexpr double kEta = 1.49, kStep = 1e-4;
  for (const auto distribution : {Distribution::kBeckmann, Distribution::kGgx}) {
    for (const double alpha : {0.1, 0.25}) {
      const auto at = [&](double a, double eta) {
        return RoughBoundary(distribution, a, eta).inner_reflectance(a, eta);
      };
      const Dual slopes =
          RoughBoundary(distribution, alpha, kEta)
              .inner_reflectance(Dual(alpha, {1, 0, 0, 0}), Dual(kEta, {0, 1, 0, 0}));
      const double da = kStep * alpha;
      const double by_alpha = (at(alpha + da, kEta) - at(alpha - da, kEta)) / (2 * da);
      const double by_eta = (at(alpha, kEta + kStep) - at(alpha, kEta - kStep)) / (2 * kStep);
      EXPECT_NEAR(slopes.d.lane[0] / by_alpha, 1, 2.0 / 63) << alpha;
      EXPECT_NEAR(slopes.d.lane[1] / by_eta, 1, 2.0 / 63) << alpha;
    }
  }
}

}  // namespace
}  // namespace limn
