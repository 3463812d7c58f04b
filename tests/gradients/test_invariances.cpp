// What must not change a gradient: texture seams, the unit of length, the depth limit beyond the
// last path, a uniform surrounding.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/integrators/check.h"
#include "support/block_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// A white body above a rough mirror.
Scene white_body(const TempFiles& files, const Mesh& mesh, bool face_normals) {
  SceneParts parts;
  parts.max_depth = 3;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.4, 0};
  parts.body = square("mirror", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.15)) +
               obj_shape("body", write_mesh(files, "body.obj", mesh), face_normals, 0.6,
                         {0, 0.9, 0}, diffuse("white", "1, 1, 1")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6")) +
               constant_light("sky", "0.5, 0.5, 0.5");
  return make_scene(files, parts);
}

class Seams : public testing::TestWithParam<bool> {};

TEST_P(Seams, ChangeNothing) {
  const TempFiles files;
  const Mesh mesh = torus_mesh(10, 6);
  const Scene welded = white_body(files, mesh, GetParam());
  const Scene split = white_body(files, seam_split(mesh), GetParam());
  const std::vector<std::string> parameters = {"body.translate.y", "body.rotate.x"};
  const GradientResult a = run_blocks(welded, parameters, 256, 1);
  const GradientResult b = run_blocks(split, parameters, 256, 2);
  for (size_t k = 0; k < parameters.size(); ++k) expect_equal(a.parameters[k], b.parameters[k]);
  CheckOptions options;
  options.parameter = "body.translate.y";
  options.block = 4;
  RunSettings settings;
  settings.spp = 512;
  EXPECT_NE(check(split, options, settings).verdict, Verdict::kDisagree);
}

INSTANTIATE_TEST_SUITE_P(, Seams, testing::Bool(),
                         [](const auto& test) { return test.param ? "flat" : "smooth"; });

Scene body_in_the_open(const TempFiles& files, const std::string& reflectance) {
  SceneParts parts;
  parts.max_depth = 64;
  parts.origin = {0, 2.5, 3};
  parts.body = obj_shape("body", write_mesh(files, "body.obj", seam_split(torus_mesh(10, 6))), true,
                         1, {0, 0.5, 0}, diffuse("paint", reflectance)) +
               constant_light("sky", "1, 1, 1");
  return make_scene(files, parts);
}

// In a uniform surrounding a white body cannot be told from what is behind it, wherever it is; a
// grey one can.
TEST(Furnace, WhiteBodyIsInvisible) {
  const TempFiles files;
  const std::vector<std::string> parameters = {"body.translate.y", "body.rotate.x",
                                               "sensor.translate.x", "body.scale"};
  const GradientResult white = run_blocks(body_in_the_open(files, "1, 1, 1"), parameters, 256, 1);
  const GradientResult grey =
      run_blocks(body_in_the_open(files, "0.9, 0.9, 0.9"), parameters, 256, 1);
  for (size_t k = 0; k < parameters.size(); ++k) {
    const Moments& blocks = white.parameters[k].total_blocks;
    const std::vector<double> zeros(blocks.size(), 0.0);
    const ZSummary z = compare_moments(blocks, zeros);
    const ZSummary z_grey = compare_moments(grey.parameters[k].total_blocks, zeros);
    fmt::print("{:24} {:3} blocks, mean z {:5.2f}, sd {:4.2f}, max |z| {:5.2f}; grey {:5.2f}\n",
               parameters[k], z.count, z.mean, z.deviation, z.largest, z_grey.largest);
    EXPECT_TRUE(z.plausible(kLevel)) << parameters[k];
    EXPECT_GT(z_grey.largest, 6) << parameters[k];
  }
}

// Everything, with one unit of length drawn as `unit`.
Scene scaled_scene(const TempFiles& files, double unit) {
  SceneParts parts;
  parts.unit = unit;
  parts.max_depth = 3;
  parts.origin = {0, 2.5, 4};
  parts.body =
      square("floor", 2.5 * unit, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
      obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.4 * unit,
                Vec3d{-0.8, 0.5, 0.2} * unit, diffuse("clay", "0.7, 0.5, 0.3")) +
      obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5 * unit,
                Vec3d{0.7, 0.6, 0.3} * unit, diffuse("chalk", "0.8, 0.8, 0.8")) +
      square("lamp", 0.8 * unit, 90, Vec3d{0.3, 3, 0.5} * unit, area_light("glow", "6, 5, 4")) +
      constant_light("sky", "0.3, 0.4, 0.5");
  return make_scene(files, parts);
}

class UnitOfLength : public testing::TestWithParam<double> {};

TEST_P(UnitOfLength, DoesNotMatter) {
  const TempFiles files;
  // Per unit of length, and per something that has none.
  const std::vector<std::string> lengths = {"cube.translate.x", "ball.translate.y",
                                            "sensor.translate.z", "lamp.translate.x"};
  const std::vector<std::string> others = {"cube.rotate.y", "ball.scale", "sensor.rotate.x",
                                           "gloss.alpha"};
  std::vector<std::string> all = lengths;
  all.insert(all.end(), others.begin(), others.end());
  const GradientResult a = run_blocks(scaled_scene(files, 1), all, 96, 1);
  const GradientResult b = run_blocks(scaled_scene(files, GetParam()), all, 96, 2);
  for (size_t k = 0; k < all.size(); ++k) {
    expect_equal(a.parameters[k], b.parameters[k], k < lengths.size() ? GetParam() : 1);
  }
}

INSTANTIATE_TEST_SUITE_P(, UnitOfLength, testing::Values(1e-3, 1e3, 1e4), [](const auto& test) {
  return test.param < 1 ? "thousandth" : test.param < 1e4 ? "thousand" : "tenthousand";
});

// Convex bodies in the open: no path has more than three vertices that matter here, whether a limit
// or roulette ends it.
TEST(Depth, LimitAndRouletteAgree) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0, 2.5, 4};
  parts.body = square("floor", 2, -90, {0, 0, 0}, diffuse("dark", "0.2, 0.2, 0.2")) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5, {0, 0.8, 0},
                         diffuse("clay", "0.5, 0.3, 0.2")) +
               constant_light("sky", "0.3, 0.4, 0.5");
  const std::vector<std::string> parameters = {"cube.translate.y", "cube.rotate.y"};
  std::vector<GradientResult> results;
  for (const auto& [depth, roulette] : {std::pair{24, 1000}, {-1, 1000}, {-1, 1}}) {
    parts.max_depth = depth;
    parts.rr_depth = roulette;
    results.push_back(run_blocks(make_scene(files, parts), parameters, 192, results.size() + 1));
  }
  for (size_t k = 0; k < parameters.size(); ++k) {
    expect_equal(results[0].parameters[k], results[1].parameters[k]);
    expect_equal(results[0].parameters[k], results[2].parameters[k]);
  }
}

// All positions are multiples of 1/64, which floats hold at either place.
Scene scene_at(const TempFiles& files, const Vec3d& offset) {
  SceneParts parts;
  parts.origin = Vec3d{0.5, 1.75, 3.5} + offset;
  parts.target = Vec3d{0, 0.5, 0} + offset;
  parts.body =
      square("floor", 3, -90, offset, diffuse("chalk", "0.75, 0.75, 0.75")) +
      obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5,
                Vec3d{0.25, 0.75, 0} + offset, diffuse("clay", "0.7, 0.5, 0.3")) +
      square("lamp", 0.5, 90, Vec3d{0.25, 2.5, 0.5} + offset, area_light("glow", "6, 5, 4"));
  return make_scene(files, parts);
}

TEST(Place, DoesNotMatter) {
  const TempFiles files;
  const std::vector<std::string> parameters = {"cube.translate.x", "glow.radiance"};
  const GradientResult here = run_blocks(scene_at(files, {0, 0, 0}), parameters, 256, 1);
  for (const double distance : {100.0, 1e5}) {
    const Vec3d offset = Vec3d{1, 1, 1} * distance;
    const GradientResult there = run_blocks(scene_at(files, offset), parameters, 256, 2);
    for (size_t k = 0; k < parameters.size(); ++k)
      expect_equal(here.parameters[k], there.parameters[k]);
  }
}

// Where floats are coarser than small steps, differences take one that they hold.
TEST(Place, DoesNotMatterToDifferences) {
  const TempFiles files;
  GradientOptions options;
  options.method = "fd";
  options.parameters = {"cube.translate.x"};
  const GradientResult here = run_blocks(scene_at(files, {0, 0, 0}), options.parameters, 256, 1);
  EXPECT_TRUE(here.warnings.empty());
  const GradientResult there = run_blocks(scene_at(files, {1e5, 1e5, 1e5}), options, 2048, 2);
  expect_equal(here.parameters[0], there.parameters[0]);
  ASSERT_EQ(there.warnings.size(), 1u);
  EXPECT_NE(there.warnings[0].find("finite differences of \"cube.translate.x\" may be off by"),
            std::string::npos);
}

// Where they hold no natural step, differences take the least that moves anything, and say so.
TEST(Place, FarDifferencesAreNotZero) {
  const TempFiles files;
  GradientOptions options;
  options.method = "fd";
  options.parameters = {"cube.translate.y"};
  const GradientResult far = run_blocks(scene_at(files, {1e6, 1e6, 1e6}), options, 64, 1);
  EXPECT_NE(far.parameters[0].image_sum.mean(0), 0);
  EXPECT_EQ(far.warnings.size(), 1u);
}

// What lies beyond the far plane is not behind an edge either.
TEST(FarPlane, HidesWhatIsBehindEdges) {
  const TempFiles files;
  const auto scene_with = [&](bool wall) {
    SceneParts parts;
    parts.body = obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5,
                           {0, 0.5, 0}, diffuse("clay", "0, 0, 0")) +
                 constant_light("sky", "0.4, 0.5, 0.7");
    if (wall) parts.body += square("wall", 9, 0, {0, 0, -6}, diffuse("paint", "0.1, 0.1, 0.1"));
    Scene scene = make_scene(files, parts);
    scene.camera.far_clip = 9;
    return scene;
  };
  const GradientResult a = run_blocks(scene_with(true), {"cube.scale"}, 64, 1);
  const GradientResult b = run_blocks(scene_with(false), {"cube.scale"}, 64, 2);
  expect_equal(a.parameters[0], b.parameters[0]);
}

}  // namespace
}  // namespace limn
