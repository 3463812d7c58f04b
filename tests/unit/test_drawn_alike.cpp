// Materials that draw alike: their densities are the same, and are those of what they draw; light
// that only one of them scatters is not lost; differences have the noise of the derivative.
#include "integrators/methods/drawn_alike.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/bsdf.h"
#include "limn/core/environment.h"
#include "limn/core/parameter.h"
#include "limn/core/rng.h"
#include "limn/core/surface_point.h"
#include "limn/integrators/differences.h"
#include "limn/integrators/gradient.h"
#include "support/meshes.h"
#include "support/running_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr char kMetal[] = R"(<bsdf type="roughconductor" id="paint"><string name="material"
    value="none"/><float name="alpha" value="0.2"/></bsdf>)";
constexpr char kClear[] =
    R"(<bsdf type="principled" id="paint"><float name="spec_trans" value="0.25"/>
    <float name="specular" value="0.5"/><float name="roughness" value="0.4"/></bsdf>)";

struct Case {
  const char* bsdf;
  const char* parameter;
  double steps[2];
};
constexpr Case kCases[] = {{kMetal, "paint.alpha", {0.1, -0.05}},
                           {kClear, "paint.spec_trans", {0.25, -0.25}}};

Scene scene_of(const TempFiles& files, const std::string& bsdf) {
  SceneParts parts;
  parts.body = square("floor", 3, -90, {0, 0, 0}, bsdf) +
               square("lamp", 1, 90, {0, 2.5, 1}, area_light("glow", "5, 5, 5"));
  return make_scene(files, parts);
}

// What is reflected and passed of uniform light.
RunningMean albedo(const Bsdf& bsdf, uint64_t seed) {
  const Vec3d n{0, 0, 1}, wi = normalize(Vec3d{0.5, 0.2, 0.7});
  RunningMean mean;
  Rng rng(seed, 0, 0);
  for (int i = 0; i < 40000; ++i) {
    const double u1 = rng.uniform(), u2 = rng.uniform();
    const auto wo = bsdf.sample(n, wi, u1, u2);
    double weight = 0;
    if (wo) {
      const BsdfValue f = bsdf.eval_with_pdf(n, wi, *wo);
      if (f.pdf > 0) weight = f.value.g / f.pdf;
    }
    mean.add(weight);
  }
  return mean;
}

TEST(DrawnAlike, LosesNoLight) {
  const TempFiles files;
  for (const Case& c : kCases) {
    const Scene scene = scene_of(files, c.bsdf);
    const Parameter parameter = find_parameter(scene, c.parameter);
    std::vector<Scene> scenes{parameter.moved(scene, c.steps[0]),
                              parameter.moved(scene, c.steps[1])};
    std::vector<RunningMean> own;
    for (const Scene& one : scenes) own.push_back(albedo(*one.shapes[0].bsdf->side(true), 1));
    draw_alike(scenes, 0, 1);
    const Bsdf* sides[2] = {scenes[0].shapes[0].bsdf->side(true),
                            scenes[1].shapes[0].bsdf->side(true)};
    for (size_t i = 0; i < 2; ++i) {
      const RunningMean alike = albedo(*sides[i], 2);
      const double error = std::hypot(own[i].standard_error(), alike.standard_error());
      EXPECT_LT(std::fabs(own[i].mean() - alike.mean()), 4 * error) << c.parameter << i;
    }
    const Vec3d n{0, 0, 1}, wi = normalize(Vec3d{0.5, 0.2, 0.7});
    Rng rng(3, 0, 0);
    for (int k = 0; k < 20; ++k) {
      const auto wo = sides[0]->sample(n, wi, rng.uniform(), rng.uniform());
      if (!wo) continue;
      EXPECT_EQ(sides[0]->pdf_solid_angle(n, wi, *wo), sides[1]->pdf_solid_angle(n, wi, *wo));
    }
    // The lamp's material is the same in both.
    EXPECT_EQ(scenes[0].shapes[1].bsdf->describe(), scene.shapes[1].bsdf->describe());
  }
}

// One texture of many moves: what draws looks up its own.
TEST(DrawnAlike, HasRoomForManyTextures) {
  const TempFiles files;
  std::string bsdf = R"(<bsdf type="principled" id="paint">)";
  for (const char* name : {"roughness", "metallic", "anisotropic", "spec_tint", "sheen",
                           "sheen_tint", "clearcoat", "clearcoat_gloss", "flatness"}) {
    bsdf += fmt::format(R"(<texture type="checkerboard" name="{}"><float name="color0" value="0.3"/>
        <float name="color1" value="0.6"/></texture>)",
                        name);
  }
  const Scene scene = scene_of(files, bsdf + "</bsdf>");
  const Parameter parameter = find_parameter(scene, "paint.roughness.color0");
  std::vector<Scene> scenes{parameter.moved(scene, 0.2), parameter.moved(scene, -0.2),
                            parameter.moved(scene, 0.1)};
  const Vec3d n{0, 0, 1}, wi = normalize(Vec3d{0.5, 0.2, 0.7}), wo = normalize(Vec3d{-0.4, 0, 0.7});
  const auto pdfs = [&](double b) {
    std::vector<double> list;
    for (const Scene& one : scenes) {
      const Shape& floor = one.shapes[0];
      Rgb<double> at[kMostTextures];
      floor.bsdf->side(true)->resolve(texture_point<double>(floor.mesh, FaceId(0), {b, b}), at);
      list.push_back(floor.bsdf->side(true)->pdf_solid_angle(n, wi, wo, at));
    }
    return list;
  };
  int moved = 0;
  std::vector<std::vector<double>> own;
  for (const double b : {0.1, 0.3}) own.push_back(pdfs(b));
  draw_alike(scenes, 0, 1);
  for (const double b : {0.1, 0.3}) {
    const std::vector<double>& before = own[b > 0.2];
    const std::vector<double> alike = pdfs(b);
    moved += before[0] != before[1];
    EXPECT_EQ(alike[0], alike[1]);
    EXPECT_EQ(alike[0], alike[2]);
    EXPECT_NEAR(alike[0], 0.5 * (before[0] + before[1]), 1e-12 * alike[0]);
  }
  EXPECT_EQ(moved, 1);
}

TEST(DrawnAlike, LeavesTheNoiseOfTheDerivative) {
  const TempFiles files;
  const Scene scene = scene_of(files, kMetal);
  RunSettings settings;
  settings.spp = 64;
  GradientOptions options;
  options.parameters = {"paint.alpha"};
  const GradientResult g = gradient(scene, options, settings);
  const DifferenceResult d = finite_differences(scene, "paint.alpha", 0.002, 0, settings);
  const Moments& sum = g.parameters[0].image_sum;
  EXPECT_LT(d.at_step.image_sum.variance(0), 4 * sum.variance(0));
}

// An image is linear in the texels of a sky, and so is what the same paths see: its differences are
// the same over any step, but for the rounding of texels to floats.
TEST(DrawnAlike, SkiesWhoseTexelsMoveAreSampledAlike) {
  const TempFiles files;
  Scene scene = scene_of(files, kMetal);
  Image sky(8, 4, 3);
  for (size_t i = 0; i < sky.data.size(); ++i) sky.data[i] = static_cast<float>(i % 7);
  scene.environment = make_map_environment(sky, 1, 0, "sky.exr");
  scene.environment_id = "sky";
  RunSettings settings;
  settings.spp = 64;
  constexpr double kStep = 0.002;
  const DifferenceResult d = finite_differences(scene, "sky.data.1.0.g", kStep, 0, settings);
  const double sum = d.at_step.image_sum.mean(0), wide = d.at_double_step.image_sum.mean(0);
  ASSERT_EQ(sky.at(0, 1, 1), 4);
  EXPECT_NEAR(sum / wide, 1, 1.5 * 0x1p-22 / kStep);
  GradientOptions options;
  options.parameters = {"sky.data.1.0.g"};
  const Moments exact = gradient(scene, options, settings).parameters[0].image_sum;
  const double error = std::sqrt(d.at_step.image_sum.variance(0) + exact.variance(0));
  EXPECT_LT(std::fabs(sum - exact.mean(0)), 4 * error);
}

}  // namespace
}  // namespace limn
