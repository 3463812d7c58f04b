// Derivatives of paths through smooth and transparent surfaces against finite differences, and
// between forward and reverse mode; what is said where edges are missing.
#include <gtest/gtest.h>

#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

std::string bsdf(const std::string& type, const std::string& id, const std::string& values = "") {
  return "<bsdf type=\"" + type + "\" id=\"" + id + "\">" + values + "</bsdf>";
}

std::string number(const std::string& name, double value) {
  return "<float name=\"" + name + "\" value=\"" + std::to_string(value) + "\"/>";
}

// A ball under a sky: of what it shows nothing has an edge but its own outline.
SceneParts ball_in_sky(const TempFiles& files, const std::string& material) {
  SceneParts parts;
  parts.max_depth = 6;
  parts.origin = {0, 1, 5};
  parts.target = {0, 0, 0};
  parts.fov = 30;
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 1,
                         {0, 0, 0}, material) +
               make_sky(files, "sky");
  return parts;
}

// Two wide borders of a medium before a sky: nothing has an edge in view. (Near the outline of a
// ball of glass slopes are so large that few samples tell nothing.)
SceneParts panes_in_sky(const TempFiles& files, const std::string& material) {
  SceneParts parts;
  parts.max_depth = 5;
  parts.origin = {0, 1, 5};
  parts.target = {0, 0, 0};
  parts.fov = 30;
  parts.body = square("pane", 50, -40, {0, 0, 0}, material) +
               square("back", 70, -55, {0, 0, -9}, "<ref id=\"stuff\"/>") + make_sky(files, "sky");
  return parts;
}

Scene scene_with(const TempFiles& files, const std::string& type) {
  const std::string material = bsdf(type, "stuff");
  const bool passes = type.find("dielectric") != std::string::npos;
  return make_scene(files, passes ? panes_in_sky(files, material) : ball_in_sky(files, material));
}

// Everything at once, with light by way of each.
SceneParts room(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 5;
  parts.origin = {1, 2.5, 5};
  parts.target = {0, 0.6, 0};
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, diffuse("ground", "0.5, 0.4, 0.3")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5,
                {0.9, 0.6, 0.3}, bsdf("dielectric", "glass")) +
      obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.4, {-0.9, 0.5, 0.2},
                bsdf("plastic", "coat", number("diffuse_reflectance", 0.6))) +
      obj_shape("block", write_mesh(files, "block.obj", cube_mesh()), true, 0.25, {0, 0.4, 0.9},
                bsdf("roughdielectric", "ice", number("alpha", 0.3))) +
      square("plate", 1.2, 0, {0, 1, -1.5}, bsdf("conductor", "mirror")) +
      square("screen", 0.5, 20, {0.3, 1.3, 0.2},
             bsdf("mask", "net", number("opacity", 0.4) + diffuse("cloth", "0.7, 0.6, 0.5"))) +
      square("lamp", 0.6, 90, {0.3, 2.6, 0.5}, area_light("glow", "6, 5, 4")) +
      make_sky(files, "sky");
  return parts;
}

class SmoothRoom : public testing::TestWithParam<std::string> {};

TEST_P(SmoothRoom, Agrees) {
  const TempFiles files;
  expect_agreement(make_scene(files, room(files)), GetParam(), 96);
}

INSTANTIATE_TEST_SUITE_P(, SmoothRoom,
                         testing::Values("ground.reflectance", "glass.specular_transmittance",
                                         "coat.eta", "mirror.k", "net.opacity", "cloth.reflectance",
                                         "ice.alpha", "ice.eta", "glow.radiance"),
                         name_of_string);

struct MovedCase {
  std::string material, parameter;
};

std::string name_of_case(const testing::TestParamInfo<MovedCase>& test) {
  return test_name(test.param.material + "_" + test.param.parameter);
}

class Moved : public testing::TestWithParam<MovedCase> {};

// The rays of smooth lobes follow what moves: nothing else carries these derivatives.
TEST_P(Moved, Agrees) {
  const TempFiles files;
  expect_agreement(scene_with(files, GetParam().material), GetParam().parameter, 256);
}

TEST_P(Moved, ReverseModeAgreesWithForwardMode) {
  const TempFiles files;
  BackwardOptions options;
  options.parameters = {GetParam().parameter};
  expect_modes_agree(scene_with(files, GetParam().material), 128, options);
}

INSTANTIATE_TEST_SUITE_P(, Moved,
                         testing::Values(MovedCase{"conductor", "ball.translate.x"},
                                         MovedCase{"conductor", "ball.scale"},
                                         MovedCase{"dielectric", "pane.rotate.x"},
                                         MovedCase{"dielectric", "stuff.eta"},
                                         MovedCase{"dielectric", "stuff.specular_transmittance"},
                                         MovedCase{"dielectric", "sensor.rotate.y"},
                                         MovedCase{"roughdielectric", "stuff.alpha"},
                                         MovedCase{"roughdielectric", "pane.rotate.x"}),
                         name_of_case);

// A derivative that lacks edges says so, and by how much light.
TEST(SmoothPaths, MissingEdgesAreTold) {
  const TempFiles files;
  const Scene scene = make_scene(files, room(files));
  const CheckResult moved = run_check(scene, "cube.translate.x", 8);
  EXPECT_TRUE(moved.gradient.incomplete);
  EXPECT_NE(moved.verdict, Verdict::kAgree);
  bool told = false;
  for (const std::string& line : moved.gradient.warnings) {
    told = told || (line.find("edges seen by way of smooth lobes of") != std::string::npos &&
                    line.find("\"ball\"") != std::string::npos);
  }
  EXPECT_TRUE(told);
  EXPECT_FALSE(run_check(scene, "ground.reflectance", 8).gradient.incomplete);
  EXPECT_TRUE(run_check(scene, "glass.eta", 8).gradient.incomplete);
}

}  // namespace
}  // namespace limn
