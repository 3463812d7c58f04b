// Edges seen straight through `mask`, `null` and `thindielectric`: derivatives against differences.
#include <gtest/gtest.h>

#include <algorithm>

#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"
#include "support/check_runs.h"
#include "support/scenes.h"

namespace limn {
namespace {

const std::string kVeil = R"(<bsdf type="mask" id="veil"><float name="opacity" value="0.4"/>
    <bsdf type="diffuse"><rgb name="reflectance" value=".7, .4, .2"/></bsdf></bsdf>)";
const std::string kPane = R"(<bsdf type="thindielectric" id="pane"/>)";
const std::string kClearPane = R"(<bsdf type="thindielectric">
    <rgb name="specular_reflectance" value="0"/></bsdf>)";
const std::string kBoard = R"(<bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
    <rgb name="color0" value=".8, .7, .6"/><rgb name="color1" value=".1, .2, .3"/>
    </texture></bsdf>)";

// A checkered cube over a floor, behind a veil and a pane, one behind the other, that the camera
// looks past with a part of its film; a round veil with interpolated normals beside it.
SceneParts parts_of(const std::string& pane, const std::string& light) {
  SceneParts parts;
  parts.max_depth = 5;
  parts.origin = {0.4, 1.2, 3.5};
  parts.target = {-0.1, 0.5, -0.5};
  parts.body = square("floor", 2, -90, {0, 0, 0}, diffuse("ground", "0.5, 0.4, 0.3")) +
               square("veil_shape", 0.5, 10, {-0.2, 0.7, 1}, kVeil) +
               square("pane_shape", 0.6, -5, {0, 0.7, 0.7}, pane) +
               R"(<shape type="sphere" id="ball"><point name="center" x=".7" y=".5" z=".2"/>
         <float name="radius" value=".3"/><ref id="veil"/></shape>)" +
               R"(<shape type="cube" id="cube"><transform name="to_world"><scale value="0.3"/>
         <rotate y="1" angle="20"/><translate x="-0.1" y="0.5" z="-0.4"/></transform>)" +
               kBoard + "</shape>" + light;
  return parts;
}
Scene behind_panes(const TempFiles& files, bool hide_emitters = false) {
  SceneParts parts =
      parts_of(kPane, square("lamp", 0.5, 80, {0.3, 1.4, -0.5}, area_light("glow", "6, 5, 4")) +
                          constant_light("sky", "0.3, 0.4, 0.5"));
  parts.hide_emitters = hide_emitters;
  return make_scene(files, parts);
}
// Shadows of point lights are seen in no mirror.
Scene in_hard_light(const TempFiles& files) {
  return make_scene(files, parts_of(kClearPane, R"(<emitter type="point" id="spark">
      <point name="position" x="-1" y="2.5" z="-1"/><rgb name="intensity" value="9, 8, 7"/>
      </emitter>)"));
}

std::string name_of(const testing::TestParamInfo<std::string>& test) {
  std::string name = test.param;
  std::replace(name.begin(), name.end(), '.', '_');
  return name;
}

void expect_complete_agreement(const Scene& scene, const std::string& parameter) {
  const CheckResult r = run_check(scene, parameter, 256);
  EXPECT_GT(r.windows.count, 0);
  EXPECT_NE(r.verdict, Verdict::kDisagree) << "suspect " << suspected(r);
  EXPECT_FALSE(r.gradient.incomplete);
}

class StraightWays : public testing::TestWithParam<std::string> {};

TEST_P(StraightWays, Agree) {
  const TempFiles files;
  expect_complete_agreement(behind_panes(files), GetParam());
}

INSTANTIATE_TEST_SUITE_P(, StraightWays,
                         testing::Values("cube.translate.x", "cube.rotate.y", "pane_shape.rotate.y",
                                         "veil_shape.translate.y", "ball.translate.x",
                                         "lamp.translate.x", "floor.translate.y",
                                         "sensor.translate.x", "veil.opacity", "pane.eta"),
                         name_of);

TEST(StraightWaysToEmitters, ShowThoseThatTheCameraDoesNotSee) {
  const TempFiles files;
  expect_complete_agreement(behind_panes(files, true), "lamp.translate.x");
}

class HardLightThroughPanes : public testing::TestWithParam<std::string> {};

TEST_P(HardLightThroughPanes, Agrees) {
  const TempFiles files;
  expect_complete_agreement(in_hard_light(files), GetParam());
}

INSTANTIATE_TEST_SUITE_P(, HardLightThroughPanes,
                         testing::Values("cube.translate.x", "spark.translate.x",
                                         "pane_shape.translate.y"),
                         name_of);

TEST(StraightWaysBackward, AgreesWithForwardMode) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 256;
  settings.seed = 3;
  BackwardOptions options;
  options.parameters = {"cube.translate.x", "pane_shape.rotate.y", "ball.translate.x",
                        "lamp.translate.x", "sensor.translate.y"};
  for (const ReverseCheck& r : check_reverse(behind_panes(files), options, settings)) {
    EXPECT_LT(std::fabs(r.z), 4.5) << r.parameter << ": " << r.forward << " +- " << r.forward_error
                                   << ", " << r.reverse << " +- " << r.reverse_error;
  }
}

}  // namespace
}  // namespace limn
