// Gradients of small scenes that hold everything at once against finite differences: every kind of
// parameter, every kind of edge.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/integrators/differences.h"
#include "support/check_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

// A leaf of two triangles, bent, seen from both sides.
Mesh leaf_mesh() {
  return make_mesh({{-1, 0, 0}, {0, -0.5f, 0.3f}, {0, 0.5f, 0.3f}, {1, 0, 0}},
                   {{0, 1, 2}, {2, 1, 3}});
}

// A sharp cube, a smooth ball and an open leaf over a glossy floor, under a lamp and a sky.
SceneParts mixed_scene(const TempFiles& files) {
  SceneParts parts;
  parts.max_depth = 4;
  parts.origin = {1, 2.5, 5};
  parts.target = {0, 0.6, 0};
  const std::string leaf =
      R"(<bsdf type="twosided">)" + diffuse("green", "0.3, 0.6, 0.2") + "</bsdf>";
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.2)) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.4,
                         {-0.8, 0.5, 0.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5,
                         {0.7, 0.6, 0.3}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("leaf", write_mesh(files, "leaf.obj", leaf_mesh()), true, 0.6,
                         {0, 1.4, -0.2}, leaf) +
               square("lamp", 0.4, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4")) +
               make_sky(files, "sky");
  return parts;
}

class MixedScene : public testing::TestWithParam<std::string> {};

TEST_P(MixedScene, Agrees) {
  const TempFiles files;
  const Scene scene = make_scene(files, mixed_scene(files));
  std::string parameter = GetParam();
  if (parameter.ends_with(':')) {
    std::string velocities;
    for (const Vec3f& x : icosphere_mesh(1).positions) {
      velocities += fmt::format("{} {} {}\n", x.y * x.y, x.x, x.z * x.x);
    }
    parameter += files.write("velocity.txt", velocities);
  }
  expect_agreement(scene, parameter, 128);
}

INSTANTIATE_TEST_SUITE_P(
    , MixedScene,
    testing::Values("cube.translate.x", "cube.rotate.y", "cube.scale", "ball.translate.y",
                    "ball.rotate.x", "ball.scale", "ball.vertex_positions:", "leaf.rotate.z",
                    "leaf.translate.y", "floor.translate.y", "floor.rotate.x", "lamp.translate.x",
                    "lamp.rotate.z", "sensor.translate.x", "sensor.translate.z", "sensor.rotate.y",
                    "sensor.fov", "gloss.alpha", "clay.reflectance", "glow.radiance", "sky.scale"),
    name_of_string);

// Each term alone left out must be noticed, and named.
class MissingTerm : public testing::TestWithParam<std::string> {};

// The lamp makes nearly all of what shading points see: `direct` where it is a term of its own.
TEST_P(MissingTerm, IsNoticedAndNamed) {
  const std::string missing = GetParam();
  const bool with_regions = missing == "direct";
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 4};
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.8,
                         {0, 1, 0}, diffuse("clay", "0.2, 0.2, 0.2")) +
               square("lamp", 1, 90, {0, 2.5, 1}, area_light("glow", "5, 5, 5"));
  const Scene scene = make_scene(files, parts);
  std::vector<std::string> terms = {"interior", "camera", "boundary"};
  std::erase(terms, missing);
  const CheckResult r =
      run_check(scene, "ball.translate.y", 1024, terms, with_regions ? "silhouettes" : "forest");
  EXPECT_EQ(r.verdict, Verdict::kDisagree);
  EXPECT_EQ(suspected(r), missing);
  const Suspicion& suspicion = r.suspicions[r.gradient.term(missing)];
  EXPECT_NEAR(suspicion.factor, 1, 6 / std::fabs(suspicion.z));
  fmt::print("  {} missing: {:.3f} of it found, z = {:.1f}\n", missing, suspicion.factor,
             suspicion.z);
}

INSTANTIATE_TEST_SUITE_P(, MissingTerm, testing::Values("interior", "camera", "boundary", "direct"),
                         [](const auto& test) { return test.param; });

// So many edges lie before the lamp that not every vertex lists their silhouettes: those of a rough
// ball, which hangs over what is seen.
TEST(AgainstDifferences, ManyEdgesBeforeALamp) {
  const TempFiles files;
  Mesh ball = icosphere_mesh(6);
  for (size_t i = 0; i < ball.positions.size(); ++i) {
    const auto height = static_cast<float>(i * 7919 % 13);
    ball.positions[i] = ball.positions[i] * (1 + 0.01f * height);
  }
  SceneParts parts;
  parts.origin = {0, 0.8, 2};
  parts.target = {0, 0, 0};
  parts.body = obj_shape("ball", write_mesh(files, "ball.obj", ball), false, 0.5, {0, 1.5, 0},
                         diffuse("skin", "0.8, 0.8, 0.8")) +
               square("floor", 3, -90, {0, 0, 0}, diffuse("ground", "0.8, 0.8, 0.8")) +
               square("lamp", 0.6, 90, {0, 3.5, 0}, area_light("glow", "15, 15, 15"));
  expect_agreement(make_scene(files, parts), "ball.scale", 256);
}

// A ball so coarse that its shading normals lie far from the geometric ones.
class CoarseBall : public testing::TestWithParam<std::tuple<std::string, int>> {
 protected:
  Scene make(const TempFiles& files) const {
    const auto& [surface, levels] = GetParam();
    const std::string bsdf =
        surface == "glossy" ? conductor("skin", 0.3) : diffuse("skin", "0.8, 0.8, 0.8");
    SceneParts parts;
    parts.origin = {0, 0.5, 4};
    parts.target = {0, 0, 0};
    parts.max_depth = 2;
    parts.body = obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(levels)), false, 1,
                           {0, 0, 0}, bsdf) +
                 square("lamp", 0.5, 90, {0.5, 2, 0.5}, area_light("glow", "9, 9, 9")) +
                 constant_light("sky", "0.5, 0.5, 0.5");
    return make_scene(files, parts);
  }
};

TEST_P(CoarseBall, AgreesByDefault) {
  const TempFiles files;
  expect_agreement(make(files), "ball.translate.x", 512);
  expect_agreement(make(files), "ball.rotate.z", 512);
}

TEST_P(CoarseBall, DisagreesWhereShadingIsDiscontinuous) {
  const TempFiles files;
  Scene scene = make(files);
  scene.shading = ShadingModel::kMitsuba;
  const CheckResult r = run_check(scene, "ball.scale", 512);
  EXPECT_EQ(r.verdict, Verdict::kDisagree);
  ASSERT_EQ(r.gradient.warnings.size(), 1u);
  scene.shading = ShadingModel::kContinuous;
  EXPECT_NE(run_check(scene, "ball.scale", 512).verdict, Verdict::kDisagree);
}

INSTANTIATE_TEST_SUITE_P(, CoarseBall,
                         testing::Combine(testing::Values("diffuse", "glossy"),
                                          testing::Values(0, 1)),
                         [](const auto& test) {
                           return std::get<0>(test.param) + std::to_string(std::get<1>(test.param));
                         });

// A room that is one mesh with a step in it: concave and convex sharp edges, seen from inside.
Mesh room_mesh() {
  // An L extruded along z: the outline counter-clockwise seen from +z, faces turned inwards.
  const std::vector<std::array<float, 2>> outline{{-2, 0}, {2, 0},     {2, 3},
                                                  {-1, 3}, {-1, 0.8f}, {-2, 0.8f}};
  const std::array<FaceIndices, 4> cap{{{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {0, 4, 5}}};
  std::vector<Vec3f> x;
  for (const float z : {-2.0f, 2.0f})
    for (const auto& [a, b] : outline) x.push_back({a, b, z});
  std::vector<FaceIndices> faces;
  for (const auto& [a, b, c] : cap) {
    faces.push_back({a, b, c});
    faces.push_back({a + 6, c + 6, b + 6});
  }
  for (uint32_t i = 0; i < 6; ++i) {
    const uint32_t j = (i + 1) % 6;
    faces.push_back({i, j + 6, j});
    faces.push_back({i, i + 6, j + 6});
  }
  return make_mesh(x, faces);
}

class Room : public testing::TestWithParam<std::string> {};

TEST_P(Room, Agrees) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 4;
  parts.origin = {0.6, 1.6, 1.8};
  parts.target = {-0.2, 0.7, -1};
  parts.fov = 80;
  parts.body = obj_shape("room", write_mesh(files, "room.obj", room_mesh()), true, 1, {0, 0, 0},
                         diffuse("wall", "0.7, 0.6, 0.5")) +
               obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), true, 0.4,
                         {0.5, 0.45, -0.7}, diffuse("card", "0.3, 0.5, 0.7")) +
               square("lamp", 0.5, 90, {0.5, 2.9, -0.3}, area_light("glow", "8, 8, 8"));
  expect_agreement(make_scene(files, parts), GetParam(), 192);
}

INSTANTIATE_TEST_SUITE_P(, Room,
                         testing::Values("box.translate.y", "box.rotate.y", "sensor.translate.x",
                                         "sensor.rotate.x", "room.translate.x", "room.scale",
                                         "lamp.translate.z", "wall.reflectance"),
                         name_of_string);

// A turned cube that shines and a ball that does not, both halfway in a glossy floor and a glossy
// wall: the lines where they cross move on the film and in the gloss.
class CrossingSurfaces : public testing::TestWithParam<std::string> {};

TEST_P(CrossingSurfaces, Agree) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {1, 2.5, 5};
  parts.target = {0, 0.2, 0};
  Rng rng(5, 0, 0);
  Vec3d rows[3];
  random_rotation(rng, rows);
  const Mesh cube = transformed(cube_mesh(), rows, 0.6, {});
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.4)) +
               square("wall", 2, 0, {0, 1, -1}, conductor("sheen", 0.3)) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube), true, 1, {-0.5, 0.2, -0.3},
                         area_light("glow", "4, 3, 2")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.8, 0.1, -0.8}, diffuse("chalk", "0.2, 0.2, 0.2")) +
               constant_light("sky", "0.3, 0.3, 0.3");
  expect_agreement(make_scene(files, parts), GetParam(), 1024);
}

INSTANTIATE_TEST_SUITE_P(, CrossingSurfaces,
                         testing::Values("cube.translate.x", "cube.translate.y", "cube.scale",
                                         "cube.rotate.z", "ball.translate.y", "ball.scale",
                                         "floor.translate.y", "floor.rotate.z", "wall.translate.z",
                                         "sensor.translate.x"),
                         name_of_string);

// The largest difference of any pixel at the wider of two steps, and the largest change from there
// to the other.
struct Steps {
  double largest = 0, apart = 0;
};
Steps at_two_steps(const Scene& scene, const std::string& name, double wide, double narrow,
                   int spp) {
  RunSettings settings;
  settings.spp = spp;
  const CentralDifferences run = central_differences(
      scene, {{find_parameter(scene, name), {wide, narrow}, {{1, 0}, {0, 1}}}}, 0, settings);
  const Moments &at_wide = run.estimates[0][0].total, &at_narrow = run.estimates[0][1].total;
  Steps steps;
  for (size_t i = 0; i < at_wide.size(); ++i) {
    steps.largest = std::max(steps.largest, std::fabs(at_wide.mean(i)));
    steps.apart = std::max(steps.apart, std::fabs(at_wide.mean(i) - at_narrow.mean(i)));
  }
  return steps;
}

// Light is linear in a lamp's radiance, and so is what few samples make of it, whatever the step:
// the lights and the highlights that they draw are those of the scene as it is.
TEST(Differences, DrawLightsAlike) {
  const TempFiles files;
  SceneParts parts = mixed_scene(files);
  parts.body += R"(<emitter type="point" id="spark"><point name="position" value="-1,2,1"/>
                   <rgb name="intensity" value="2,3,4"/></emitter>)";
  const Scene scene = make_scene(files, parts);
  for (const char* name : {"glow.radiance", "spark.intensity", "sky.scale"}) {
    const Steps steps = at_two_steps(scene, name, 0.5, 1e-4, 4);
    EXPECT_GT(steps.largest, 0) << name;
    EXPECT_LT(steps.apart, 1e-6 * steps.largest) << name;
  }
}

// Radiance is a polynomial of reflectances, so differences change with the square of a small step:
// no path ends in one of the images alone, or goes to the highlight in one of them alone.
TEST(Differences, GoAlikeWhateverTheMaterials) {
  const TempFiles files;
  SceneParts parts = mixed_scene(files);
  parts.max_depth = 6;
  parts.rr_depth = 1;
  const Scene scene = make_scene(files, parts);
  for (const char* name : {"clay.reflectance", "chalk.reflectance", "green.reflectance"}) {
    const Steps steps = at_two_steps(scene, name, 1e-3, 1e-5, 64);
    EXPECT_GT(steps.largest, 0) << name;
    EXPECT_LT(steps.apart, 1e-4 * steps.largest) << name;
  }
}

// The image begins to shine as the reflectance of black surfaces grows: by lamps, the sky and
// lights without extent, straight and by way of others, whatever roulette makes of paths that end
// there.
TEST(Paths, BlackSurfacesBeginToShine) {
  const TempFiles files;
  SceneParts parts;
  parts.max_depth = 4;
  parts.rr_depth = 1;
  parts.origin = {1, 2.5, 5};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("soot", "0, 0, 0")) +
               square("wall", 2, 0, {0, 1, -1}, diffuse("chalk", "0.8, 0.7, 0.6")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5,
                         {0.7, 0.6, 0.3}, diffuse("coal", "0, 0, 0")) +
               square("lamp", 0.4, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4")) +
               make_sky(files, "sky") +
               R"(<emitter type="point" id="spark"><point name="position" value="-1,2,1"/>
                  <rgb name="intensity" value="2,3,4"/></emitter>)";
  const Scene scene = make_scene(files, parts);
  for (const char* name : {"soot.reflectance", "coal.reflectance"}) {
    const CheckResult r = run_check(scene, name, 1024);
    EXPECT_EQ(r.verdict, Verdict::kAgree) << name;
    EXPECT_GT(r.total.gradient, 1) << name;
  }
}

// Roulette and hidden emitters change the paths, not what they mean.
TEST(Paths, RouletteAgrees) {
  const TempFiles files;
  SceneParts parts = mixed_scene(files);
  parts.max_depth = -1;
  parts.rr_depth = 2;
  expect_agreement(make_scene(files, parts), "cube.translate.x", 128);
}

TEST(Paths, HiddenEmittersAgree) {
  const TempFiles files;
  SceneParts parts = mixed_scene(files);
  parts.hide_emitters = true;
  parts.origin = {0.3, 3.5, 4};  // the lamp stands before the floor
  const Scene scene = make_scene(files, parts);
  for (const char* name : {"lamp.translate.x", "cube.translate.x", "sensor.translate.y"}) {
    expect_agreement(scene, name, 128);
  }
}

TEST(Paths, FiltersAgree) {
  const TempFiles files;
  SceneParts parts = mixed_scene(files);
  for (const char* film :
       {R"(<rfilter type="gaussian"/>)", R"(<rfilter type="lanczos"/>)",
        R"(<rfilter type="tent"/><boolean name="sample_border" value="true"/>)"}) {
    parts.film = film;
    expect_agreement(make_scene(files, parts), "sensor.rotate.y", 128);
  }
}

}  // namespace
}  // namespace limn
