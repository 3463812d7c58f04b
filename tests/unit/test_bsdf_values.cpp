// Values of BSDFs as Mitsuba has them.
#include <gtest/gtest.h>

#include "limn/core/bsdf.h"
#include "limn/core/make_bsdf.h"
#include "limn/core/rng.h"
#include "src/bsdf/microfacet.h"
#include "support/running_mean.h"
#include "support/test_properties.h"

namespace limn {
namespace {

using test::TestProperties;

// wi and wo around n = (0, 0, 1), tangent (1, 0, 0), single precision.
const Vec3d kDirections[][2] = {
    {{0.309426374, 0.206284249, 0.928279122}, {-0.267261242, -0.32071349, 0.908688223}},
    {{0.92998111, 0.116247639, 0.348742916}, {-0.835169981, 0.357929992, 0.41758499}},
    {{0.107832773, -0.215665546, 0.970494959}, {0.609207699, 0.609207699, 0.507673083}}};

// The share of slopes up to x, of microfacet::beckmann_slope's density, but for a factor.
double slopes_up_to(double x, double c, double s) {
  return c * std::erfc(-x) + s * std::exp(-x * x) / std::sqrt(kPi);
}

TEST(Beckmann, SlopesInvertTheirDistribution) {
  for (const double c : {0.0, 0.01, 0.3, 0.8, 0.999, 1.0}) {
    const double s = std::sqrt(1 - c * c);
    const double all = slopes_up_to(c < 7 * s ? c / s : 7, c, s);
    for (double u = 1.0 / 512; u < 1; u += 1.0 / 256) {
      EXPECT_NEAR(slopes_up_to(microfacet::beckmann_slope(c, s, u), c, s), u * all, 1e-13);
      EXPECT_NEAR(std::erfc(-microfacet::gaussian_slope(u)), 2 * u, 1e-11);
    }
  }
}

struct Reference {
  std::string type;
  std::map<std::string, TestProperties::Value> values;
  Rgb<double> f[3];  // for each pair of directions
};

// eval of Mitsuba 3.9.1, variant scalar_rgb (single precision), through its Python module.
const Reference kReferences[] = {
    {"roughplastic",
     {{"alpha", 0.1},
      {"int_ior", 1.49},
      {"ext_ior", 1.0},
      {"diffuse_reflectance", Rgb<double>{0.2, 0.5, 0.9}}},
     {{0.27473664, 0.35958552, 0.47271737},
      {0.020638919, 0.051597293, 0.09287513},
      {0.030059174, 0.075147927, 0.13526627}}},
    {"roughplastic",
     {{"alpha", 0.3},
      {"int_ior", 1.7},
      {"ext_ior", 1.0},
      {"distribution", "ggx"},
      {"nonlinear", true},
      {"diffuse_reflectance", Rgb<double>{0.2, 0.5, 0.9}},
      {"specular_reflectance", Rgb<double>{0.9, 0.7, 0.8}}},
     {{0.071773939, 0.098227106, 0.18900642},
      {0.023679316, 0.034021318, 0.067123979},
      {0.014662191, 0.03363093, 0.078664951}}},
    {"roughconductor",
     {{"alpha_u", 0.1}, {"alpha_v", 0.4}, {"distribution", "ggx"}},
     {{1.8504317, 1.8504317, 1.8504317},
      {0.4337672, 0.4337672, 0.4337672},
      {0.0052903085, 0.0052903085, 0.0052903085}}},
    {"roughconductor",
     {{"alpha_u", 0.5}, {"alpha_v", 0.2}, {"distribution", "beckmann"}},
     {{0.78322303, 0.78322303, 0.78322303},
      {0.00026583212, 0.00026583212, 0.00026583212},
      {0.092778087, 0.092778087, 0.092778087}}},
    {"principled",
     {{"base_color", Rgb<double>{0.2, 0.5, 0.9}}},
     {{0.10644494, 0.19321853, 0.30891663},
      {0.037036177, 0.074775323, 0.12509418},
      {0.035114907, 0.0838935, 0.14893161}}},
    {"principled",
     {{"base_color", Rgb<double>{0.2, 0.5, 0.9}},
      {"roughness", 0.3},
      {"metallic", 0.6},
      {"specular", 0.8},
      {"spec_tint", 0.4}},
     {{0.64916718, 1.518885, 2.6785085},
      {0.01392339, 0.032578405, 0.057451766},
      {0.014502296, 0.035981547, 0.064620547}}},
    {"principled",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.7},
      {"sheen", 0.8},
      {"sheen_tint", 0.5},
      {"flatness", 0.4}},
     {{0.2155796, 0.089439921, 0.038984049},
      {0.16621976, 0.078162566, 0.042939693},
      {0.12641369, 0.049984064, 0.019412205}}},
    {"principled",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.4},
      {"clearcoat", 0.7},
      {"clearcoat_gloss", 0.3},
      {"eta", 1.4}},
     {{0.34104019, 0.19641776, 0.13856879},
      {0.10619217, 0.043782596, 0.018818762},
      {0.13134132, 0.050377183, 0.017991522}}},
    {"principled",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.5},
      {"anisotropic", 0.8},
      {"metallic", 0.9},
      {"spec_tint", 0.3}},
     {{0.68513387, 0.25854337, 0.087907158},
      {0.016524091, 0.0064855451, 0.0024701261},
      {0.053307366, 0.020095596, 0.0068108891}}},
    {"principled",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.5},
      {"eta", 0.8},
      {"metallic", 0.4},
      {"spec_tint", 0.3},
      {"clearcoat", 1.0}},
     {{0.57814878, 0.24788377, 0.1157778},
      {0.19260213, 0.15486299, 0.13976732},
      {0.099887058, 0.038627103, 0.014123121}}},
};

// Mitsuba's quadrature of a boundary's transmittance is off by up to 6e-4 for GGX, ours by 2e-4,
// twice in a value (transmittances) and once more for light from inside.
double tolerance(const Reference& r) { return r.type == "roughplastic" ? 2e-3 : 2e-5; }

TEST(BsdfValues, AreMitsubas) {
  const Vec3d n{0, 0, 1};
  for (const Reference& r : kReferences) {
    TestProperties properties("bsdf", r.type, r.values);
    const auto bsdf = make_bsdf(properties);
    // The tangent is the only texture, if there is any.
    const Rgb<double> at[1] = {{1, 0, 0}};
    ASSERT_LE(bsdf->texture_count(), 1);
    for (int i = 0; i < 3; ++i) {
      const Rgb<double> f =
          bsdf->eval(n, normalize(kDirections[i][0]), normalize(kDirections[i][1]), at);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(f[c] / r.f[i][c], 1, tolerance(r)) << bsdf->describe() << ", pair " << i;
      }
    }
  }
}

// wi and wo around n = (0, 0, 1), from both sides: reflected and passed.
const Vec3d kThrough[][2] = {
    {{0.309426374, 0.206284249, 0.928279122}, {-0.267261242, -0.32071349, 0.908688223}},
    {{0.309426374, 0.206284249, 0.928279122}, {-0.110263569, -0.330790708, -0.937240339}},
    {{0.92998111, 0.116247639, 0.348742916}, {-0.835169981, 0.357929992, -0.41758499}},
    {{0.309426374, 0.206284249, -0.928279122}, {-0.267261242, -0.32071349, -0.908688223}},
    {{0.107832773, 0.215665546, -0.970494959}, {-0.341881729, -0.227921153, 0.911684612}},
    {{0.680413817, 0.272165527, -0.680413817}, {-0.702246883, -0.117041147, 0.702246883}}};

struct ReferenceThrough {
  std::string type;
  std::map<std::string, TestProperties::Value> values;
  Rgb<double> f[6];  // for each pair of directions
};
const ReferenceThrough kReferencesThrough[] = {
    {"principled",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.5},
      {"spec_trans", 0.7},
      {"eta", 1.4}},
     {{0.10324365, 0.059856858, 0.042502142},
      {0.20252044, 0.12401795, 0.071601793},
      {0.01580444, 0.0096782045, 0.0055877138},
      {0.025028665, 0.025028665, 0.025028665},
      {1.2586927, 0.77078879, 0.4450151},
      {0.28628588, 0.17531359, 0.10121734}}},
    {"principled",
     {{"base_color", Rgb<double>{0.2, 0.5, 0.9}},
      {"roughness", 0.4},
      {"spec_trans", 0.6},
      {"anisotropic", 0.5},
      {"metallic", 0.2},
      {"clearcoat", 0.5},
      {"sheen", 0.4}},
     {{0.18728821, 0.33708972, 0.53682506},
      {0.015038827, 0.023778472, 0.031902168},
      {0.0011087623, 0.0017531071, 0.0023520398},
      {0.042400215, 0.042400215, 0.042400215},
      {0.52827746, 0.83528, 1.1206458},
      {0.029591091, 0.04678762, 0.062772177}}},
    {"principledthin",
     {{"base_color", Rgb<double>{0.8, 0.3, 0.1}},
      {"roughness", 0.5},
      {"spec_trans", 0.6},
      {"diff_trans", 0.8},
      {"eta", 1.4},
      {"spec_tint", 0.3}},
     {{0.08199501, 0.039627563, 0.022680586},
      {0.56217891, 0.21081708, 0.070272364},
      {0.024222068, 0.0090832757, 0.0030277586},
      {0.08199501, 0.039627563, 0.022680586},
      {0.55423015, 0.20783632, 0.069278769},
      {0.97084886, 0.36406836, 0.12135611}}},
    {"principledthin",
     {{"base_color", Rgb<double>{0.2, 0.5, 0.9}},
      {"roughness", 0.4},
      {"anisotropic", 0.5},
      {"spec_trans", 0.3},
      {"diff_trans", 1.2},
      {"sheen", 0.5},
      {"sheen_tint", 0.4},
      {"flatness", 0.3}},
     {{0.039345324, 0.061312936, 0.090603076},
      {0.084631935, 0.21157981, 0.38084367},
      {0.011347847, 0.028369617, 0.051065307},
      {0.039345324, 0.061312936, 0.090603076},
      {0.14631246, 0.36578119, 0.65840608},
      {0.055428114, 0.13857028, 0.2494265}}},
};

TEST(BsdfValues, OfTransmissionAreMitsubas) {
  for (const ReferenceThrough& r : kReferencesThrough) {
    TestProperties properties("bsdf", r.type, r.values);
    const auto bsdf = make_bsdf(properties);
    const Rgb<double> at[1] = {{1, 0, 0}};
    ASSERT_LE(bsdf->texture_count(), 1);
    for (int i = 0; i < 6; ++i) {
      const bool front = kThrough[i][0].z > 0;
      const Rgb<double> f = bsdf->side(front)->eval(
          {0, 0, front ? 1.0 : -1.0}, normalize(kThrough[i][0]), normalize(kThrough[i][1]), at);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(f[c] / r.f[i][c], 1, 2e-5) << bsdf->describe() << ", pair " << i;
      }
    }
  }
}

// Light on either side of the surface and draws there, by uniform directions and by `sample`.
TEST(BsdfValues, OfTransmissionAreSampledByTheirDensity) {
  constexpr int kDraws = 200000;
  const Vec3d n{0, 0, 1}, wi = normalize(Vec3d{0.5, 0.3, 0.7});
  for (const ReferenceThrough& r : kReferencesThrough) {
    TestProperties properties("bsdf", r.type, r.values);
    const auto bsdf = make_bsdf(properties);
    const Rgb<double> at[1] = {{1, 0, 0}};
    for (const bool front : {true, false}) {
      const Bsdf& side = *bsdf->side(front);
      // Of each side: what is drawn there, and its light.
      RunningMean uniform[2][2], drawn[2][2];
      Rng rng(1, 2, 3);
      for (int i = 0; i < kDraws; ++i) {
        const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
        const double sine = std::sqrt(1 - z * z);
        const Vec3d w{sine * std::cos(phi), sine * std::sin(phi), z};
        const BsdfValue f = side.eval_with_pdf(n, wi, w, at);
        const double u1 = rng.uniform(), u2 = rng.uniform();
        const auto wo = side.sample(n, wi, u1, u2, at);
        const BsdfValue g = wo ? side.eval_with_pdf(n, wi, *wo, at) : BsdfValue{};
        for (const bool below : {false, true}) {
          const double here = (z < 0) == below ? 4 * kPi : 0;
          uniform[below][0].add(here * f.pdf);
          uniform[below][1].add(here * f.value.g);
          const bool there = wo && (wo->z < 0) == below;
          drawn[below][0].add(there ? 1 : 0);
          drawn[below][1].add(there ? g.value.g / g.pdf : 0);
        }
      }
      for (const bool below : {false, true}) {
        for (int k = 0; k < 2; ++k) {
          const RunningMean &a = uniform[below][k], &b = drawn[below][k];
          const double error = std::hypot(a.standard_error(), b.standard_error());
          EXPECT_NEAR(a.mean(), b.mean(), 4.5 * error) << bsdf->describe() << ", below " << below;
          EXPECT_GT(b.mean(), 0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace limn
