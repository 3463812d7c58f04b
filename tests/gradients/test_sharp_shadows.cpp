// Derivatives of sharp shadows against finite differences, in scenes that hold everything at once.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

const char* kBulb =
    R"(<emitter type="point" id="bulb"><point name="position" value="-1.2,2.2,1.1"/>
       <rgb name="intensity" value="9,8,7"/></emitter>)";
const char* kTorch =
    R"(<emitter type="spot" id="torch"><rgb name="intensity" value="20,30,40"/>
       <float name="cutoff_angle" value="35"/><float name="beam_width" value="12"/>
       <transform name="to_world"><lookat origin="1.4,2.6,1.2" target="0,0.4,0" up="0,1,0"/>
       </transform></emitter>)";
const char* kSun =
    R"(<emitter type="directional" id="sun"><vector name="direction" value="0.4,-1,-0.3"/>
       <rgb name="irradiance" value="2,2,2.5"/></emitter>)";

// A flat-shaded cube, a ball with computed normals and an open leaf above a glossy floor and before
// a matt wall that the floor shows.
Scene shadow_scene(const TempFiles& files, const std::string& lights, bool hide_emitters = false) {
  SceneParts parts;
  parts.max_depth = 4;
  parts.hide_emitters = hide_emitters;
  parts.origin = {0.4, 2.2, 5};
  parts.target = {0, 0.6, 0};
  const Mesh leaf =
      make_mesh({{-1, 0, 0}, {0, -0.5f, 0.3f}, {0, 0.5f, 0.3f}, {1, 0, 0}}, {{0, 1, 2}, {2, 1, 3}});
  const std::string both =
      R"(<bsdf type="twosided">)" + diffuse("green", "0.3, 0.6, 0.2") + "</bsdf>";
  parts.body =
      square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
      square("wall", 2.5, 0, {0, 1.5, -1.5}, diffuse("plaster", "0.7, 0.7, 0.6")) +
      obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.35, {-0.8, 0.55, 0.2},
                diffuse("clay", "0.7, 0.5, 0.3")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.45,
                {0.6, 0.7, 0.1}, diffuse("chalk", "0.8, 0.8, 0.8")) +
      obj_shape("leaf", write_mesh(files, "leaf.obj", leaf), true, 0.5, {0, 1.4, 0.3}, both) +
      lights;
  return make_scene(files, parts);
}

class SharpShadows : public testing::TestWithParam<std::string> {};

TEST_P(SharpShadows, Agree) {
  const TempFiles files;
  const CheckResult r =
      run_check(shadow_scene(files, std::string(kBulb) + kTorch + kSun), GetParam(), 256);
  EXPECT_NE(r.verdict, Verdict::kDisagree) << "suspect: " << suspected(r);
}

INSTANTIATE_TEST_SUITE_P(, SharpShadows,
                         testing::Values("cube.translate.x", "cube.rotate.y", "ball.translate.y",
                                         "ball.scale", "leaf.rotate.z", "leaf.translate.x",
                                         "floor.translate.y", "floor.rotate.x", "wall.translate.z",
                                         "bulb.translate.x", "bulb.translate.y", "bulb.intensity",
                                         "torch.translate.z", "torch.rotate.x",
                                         "torch.cutoff_angle", "torch.beam_width", "sun.rotate.z",
                                         "sun.irradiance", "sensor.translate.x", "sensor.rotate.y",
                                         "sensor.fov"),
                         name_of_string);

// Delta lights beside one that shapes and sky make.
TEST(SharpShadowsBeside, OtherLights) {
  const TempFiles files;
  const std::string lamp = square("lamp", 0.4, 90, {0.9, 1.75, 0.9}, area_light("glow", "6, 5, 4"));
  for (const bool hidden : {false, true}) {
    const Scene scene = shadow_scene(files, kBulb + lamp + make_sky(files, "sky"), hidden);
    EXPECT_NE(run_check(scene, "cube.translate.x", 256).verdict, Verdict::kDisagree);
    EXPECT_NE(run_check(scene, "lamp.translate.x", 256).verdict, Verdict::kDisagree);
  }
}

// The edges of shadows left out must be noticed, and named.
TEST(SharpShadowsMissing, AreNoticedAndNamed) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 4};
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.6,
                         {0.2, 0.9, 0.3}, diffuse("clay", "0.6, 0.4, 0.3")) +
               kBulb;
  const Scene scene = make_scene(files, parts);
  EXPECT_NE(run_check(scene, "ball.translate.x", 256).verdict, Verdict::kDisagree);
  const CheckResult r =
      run_check(scene, "ball.translate.x", 256, {"interior", "camera", "boundary"});
  EXPECT_EQ(r.verdict, Verdict::kDisagree);
  EXPECT_EQ(suspected(r), "shadow");
}

}  // namespace
}  // namespace limn
