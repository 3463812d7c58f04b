// Edges seen by way of flat mirrors: which parts of surfaces are such mirrors, derivatives against
// differences, and what is told where others are missing.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "integrators/edges/flat_mirrors.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

const std::string kMirror =
    R"(<bsdf type="conductor" id="silver"><string name="material" value="Ag"/></bsdf>)";
const std::string kTwoSided = R"(<bsdf type="twosided"><bsdf type="conductor"/></bsdf>)";

// A checkered cube between a diffuse floor and two mirrors that meet at a corner.
Scene corner(const TempFiles& files, const std::string& body = "") {
  SceneParts parts;
  parts.max_depth = 4;
  parts.origin = {0.4, 1.2, 3.5};
  parts.target = {-0.2, 0.6, -1};
  const std::string board = R"(<bsdf type="diffuse"><texture type="checkerboard" name="reflectance">
      <rgb name="color0" value=".8, .7, .6"/><rgb name="color1" value=".1, .2, .3"/>
      </texture></bsdf>)";
  parts.body = square("floor", 2, -90, {0, 0, 0}, diffuse("ground", "0.5, 0.4, 0.3")) +
               square("wall", 1, 2, {-0.3, 1.1, -1.5}, kMirror) +
               R"(<shape type="rectangle" id="side"><transform name="to_world"><scale value="1"/>
         <rotate y="1" angle="85"/><translate x="-1.5" y="1.1" z="-0.3"/></transform>)" +
               kTwoSided + "</shape>" +
               R"(<shape type="cube" id="cube"><transform name="to_world"><scale value="0.3"/>
         <rotate y="1" angle="20"/><translate x="-0.2" y="0.5"/></transform>)" +
               board + "</shape>" +
               square("lamp", 0.5, 90, {0.3, 2.1, 0.5}, area_light("glow", "6, 5, 4")) +
               constant_light("sky", "0.3, 0.4, 0.5") + body;
  return make_scene(files, parts);
}

class FlatMirrorsInView : public testing::TestWithParam<std::string> {};

TEST_P(FlatMirrorsInView, Agree) {
  const TempFiles files;
  expect_agreement(corner(files), GetParam(), 256);
}

INSTANTIATE_TEST_SUITE_P(, FlatMirrorsInView,
                         testing::Values("cube.translate.x", "cube.rotate.y", "wall.translate.z",
                                         "wall.rotate.x", "side.rotate.y", "lamp.translate.x",
                                         "floor.translate.y", "sensor.translate.x",
                                         "sensor.rotate.y"),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

TEST(FlatMirrorsBackward, AgreesWithForwardMode) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 256;
  settings.seed = 3;
  BackwardOptions options;
  options.parameters = {"cube.translate.x", "wall.rotate.x", "side.translate.x", "floor.rotate.z",
                        "sensor.translate.y"};
  for (const ReverseCheck& r : check_reverse(corner(files), options, settings)) {
    EXPECT_LT(std::fabs(r.z), 4.5) << r.parameter << ": " << r.forward << " +- " << r.forward_error
                                   << ", " << r.reverse << " +- " << r.reverse_error;
  }
}

// A ball and a cube that emit, one before the other, behind the two planes of a slab that has
// no sides and reflects nothing; the camera also looks past it.
Scene behind_slab(const TempFiles& files, const std::string& body = "") {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0.6, 0.9, 3.5};
  parts.target = {0, 0.3, 0};
  parts.fov = 30;
  const std::string slab = files.write("slab.obj",
                                       "v -1 -0.8 1.5\nv 0.4 -0.8 1.25\nv 0.4 0.8 1.25\n"
                                       "v -1 0.8 1.5\nv -1 -0.8 1.1\nv 0.4 -0.8 0.85\n"
                                       "v 0.4 0.8 0.85\nv -1 0.8 1.1\nf 1 2 3 4\nf 8 7 6 5\n");
  const std::string glass = R"(<bsdf type="dielectric" id="glass">
      <rgb name="specular_reflectance" value="0"/></bsdf>)";
  parts.body = obj_shape("slab", slab, true, 1, {0, 0, 0}, glass) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.4,
                         {0.1, 0.3, 0}, area_light("red", "3, 1, 0.5")) +
               R"(<shape type="cube" id="cube"><transform name="to_world"><scale value="0.4"/>
         <rotate y="1" angle="30"/><translate x="-0.4" y="0.3" z="-1"/></transform>)" +
               area_light("blue", "0.5, 1, 3") + "</shape>" +
               constant_light("sky", "0.2, 0.3, 0.4") + body;
  return make_scene(files, parts);
}

class FlatGlassInView : public testing::TestWithParam<std::string> {};

TEST_P(FlatGlassInView, Agrees) {
  const TempFiles files;
  const CheckResult r = run_check(behind_slab(files), GetParam(), 512);
  EXPECT_GT(r.windows.count, 0);
  EXPECT_NE(r.verdict, Verdict::kDisagree) << "suspect " << suspected(r);
  EXPECT_FALSE(r.gradient.incomplete);
}

INSTANTIATE_TEST_SUITE_P(, FlatGlassInView,
                         testing::Values("ball.translate.x", "cube.rotate.y", "slab.rotate.y",
                                         "slab.translate.x", "sensor.translate.x",
                                         "sensor.rotate.x", "glass.eta"),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::replace(name.begin(), name.end(), '.', '_');
                           return name;
                         });

TEST(FlatGlassBackward, AgreesWithForwardMode) {
  const TempFiles files;
  RunSettings settings;
  settings.spp = 256;
  settings.seed = 3;
  BackwardOptions options;
  options.parameters = {"ball.translate.x", "slab.rotate.y", "sensor.translate.y", "glass.eta"};
  for (const ReverseCheck& r : check_reverse(behind_slab(files), options, settings)) {
    EXPECT_LT(std::fabs(r.z), 4.5) << r.parameter << ": " << r.forward << " +- " << r.forward_error
                                   << ", " << r.reverse << " +- " << r.reverse_error;
  }
}

// What rough surfaces see through glass is missing.
TEST(FlatGlass, ShowsEdgesToTheCameraAlone) {
  const TempFiles files;
  const Scene scene =
      behind_slab(files, square("floor", 2, -90, {0, -0.3, 0}, diffuse("ground", "0.5, 0.4, 0.3")));
  const CheckResult result = run_check(scene, "ball.translate.x", 8);
  EXPECT_TRUE(result.gradient.incomplete);
}

// Points of a lens on both sides of a refracting plane see edges by way of it from either side.
TEST(FlatGlass, MustNotCutTheLens) {
  const TempFiles files;
  for (const auto& [radius, incomplete] : {std::pair(0.1, false), std::pair(20.0, true)}) {
    Scene scene = behind_slab(files);
    scene.camera.aperture_radius = radius;
    scene.camera.focus_distance = 3;
    const CheckResult result = run_check(scene, "ball.translate.x", 32);
    EXPECT_EQ(result.gradient.incomplete, incomplete) << radius;
  }
}

// Chains of three mirrors are left, and what curved ones show.
TEST(FlatMirrors, WhatIsMissingIsTold) {
  const TempFiles files;
  const auto warned = [&](const Scene& scene) {
    const CheckResult result = run_check(scene, "cube.translate.x", 8);
    for (const std::string& line : result.gradient.warnings) {
      if (line.find("edges seen by way of smooth lobes of") != line.npos) {
        EXPECT_TRUE(result.gradient.incomplete);
        return line;
      }
    }
    EXPECT_FALSE(result.gradient.incomplete);
    return std::string();
  };
  EXPECT_EQ(warned(corner(files)), "");
  const std::string ball = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)),
                                     false, 0.3, {0.9, 0.4, 0.3}, "<ref id=\"silver\"/>");
  const std::string line = warned(corner(files, ball));
  EXPECT_NE(line.find("\"ball\""), line.npos) << line;
  // Two small mirrors are seen beside the wall and the side; of three one is not.
  const auto with = [&](const std::vector<std::string>& names) {
    std::string small;
    for (const std::string& name : names) {
      const double size = 0.02 * static_cast<double>(name.size());
      small += square(name, size, 90, {0.5, 4 * size, 0.8}, "<ref id=\"silver\"/>");
    }
    return warned(corner(files, ball + small));
  };
  EXPECT_EQ(with({"least", "larger"}).find("flat mirrors"), std::string::npos);
  const std::string five = with({"least", "largest", "larger"});
  EXPECT_NE(five.find("of 5 flat mirrors and panes only the 4 with the most area times reflectance "
                      "show edges, those of \"side\", \"wall\", \"largest\", \"larger\":"),
            five.npos)
      << five;
}

std::unique_ptr<const FlatMirrors> mirrors_of(const Scene& scene, const std::string& parameter) {
  Scene seeded = deep_copy(scene);
  find_parameter(scene, parameter).seed(seeded, 0);
  static std::vector<std::unique_ptr<Scene>> kept;  // they refer to it
  kept.push_back(std::make_unique<Scene>(std::move(seeded)));
  return FlatMirrors::make(*kept.back());
}

TEST(FlatMirrors, AreFacesInOnePlaneThatMoveAsOne) {
  const TempFiles files;
  const Scene scene = corner(files);
  const auto found = mirrors_of(scene, "wall.rotate.x");
  ASSERT_TRUE(found);
  ASSERT_EQ(found->mirrors().size(), 2u);
  EXPECT_EQ(found->chains().size(), 4u);
  for (uint32_t m = 0; m < 2; ++m) {
    const FlatMirrors::Mirror& mirror = found->mirrors()[m];
    EXPECT_EQ(mirror.faces.size(), 2u);
    for (const FaceRef face : mirror.faces) EXPECT_EQ(found->of(face), m);
    EXPECT_NEAR(mirror.area, 4, 1e-5);
  }
  EXPECT_EQ(found->of({ShapeId(0), FaceId(0)}), FlatMirrors::kNone);
  // The wall reflects to its front alone, the side to both.
  const uint32_t wall = found->of({ShapeId(1), FaceId(0)}), side = 1 - wall;
  EXPECT_TRUE(found->reflects_to(wall, {0, 1, 0}));
  EXPECT_FALSE(found->reflects_to(wall, {0, 1, -5}));
  EXPECT_TRUE(found->reflects_to(side, {0, 1, 0}));
  EXPECT_TRUE(found->reflects_to(side, {-5, 1, 0}));
  // A corner that leaves the plane alone takes its face along.
  const std::string file = files.write("velocity.txt", "0 0 1\n0 0 0\n0 0 0\n0 0 0\n");
  EXPECT_EQ(mirrors_of(scene, "wall.vertex_positions:" + file)->mirrors().size(), 3u);
  SceneParts rough;
  rough.body = ball_over_gloss(files, 0.1);
  EXPECT_EQ(FlatMirrors::make(make_scene(files, rough)), nullptr);
}

}  // namespace
}  // namespace limn
