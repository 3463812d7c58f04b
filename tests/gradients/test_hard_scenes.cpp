// Scenes that are easy to get wrong: clip planes that cut geometry, surfaces in one place, normals
// that cancel, needles.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/block_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// A glowing floor at y = -1 below a camera that looks along -z, 90 degrees wide, with N by N
// pixels. The clip planes leave its depths from n = 2 to f = 50: on the film, rows from y = -1 / n
// to -1 / f (in half widths). A screen at depth 10 hides what lies above -1 / 20 in the left half,
// so the far cut.
class ClippedFloor : public testing::Test {
 protected:
  static constexpr int kPixels = 8;

  static Scene scene(bool screen) {
    const TempFiles files;
    SceneParts parts;
    parts.max_depth = 1;
    parts.origin = {0, 0, 0};
    parts.target = {0, 0, -1};
    parts.fov = 90;
    parts.width = parts.height = kPixels;
    parts.body = square("floor", 200, -90, {0, -1, 0}, area_light("glow", "1, 1, 1"));
    if (screen) {
      parts.body += square("screen", 10, 0, {-10, 9.5, -10}, diffuse("black", "0, 0, 0"));
    }
    Scene result = make_scene(files, parts);
    result.camera.near_clip = 2;
    result.camera.far_clip = 50;
    return result;
  }

  // rows: the derivative of the height of the near cut on the film, and of the far cut, in half
  // widths.
  static void expect(const std::string& parameter, double near, double far, bool screen = false) {
    const GradientResult result = run_blocks(scene(screen), {parameter}, 64, 1);
    const double area = kPixels * kPixels / 2.0;  // of one half width
    const double exact = 3 * area * (far * (screen ? 0.5 : 1) - near);
    const Moments& sum = result.parameters[0].image_sum;
    fmt::print("{}: {} +- {}, exact {}\n", parameter, sum.mean(0), std::sqrt(sum.variance(0)),
               exact);
    EXPECT_TRUE(compare_moments(sum, std::vector<double>{exact}).plausible(kLevel));
  }
};

TEST_F(ClippedFloor, MovesWithTheCamera) { expect("sensor.translate.y", -1.0 / 2, -1.0 / 50); }
TEST_F(ClippedFloor, MovesWithTheFloor) { expect("floor.translate.y", 1.0 / 2, 1.0 / 50); }
TEST_F(ClippedFloor, FieldOfView) {
  // y = -1 / (n tan(fov / 2)), and tan' = (1 + 1) / 2 per radian.
  const double per_degree = kPi / 180;
  expect("sensor.fov", per_degree / 2, per_degree / 50);
}
TEST_F(ClippedFloor, BehindAScreen) { expect("floor.translate.y", 1.0 / 2, 1.0 / 50, true); }

TEST(ClippedCube, AgreesWithDifferences) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0.6, 1.8, 3.4};
  parts.body = square("floor", 3, -90, {}, diffuse("chalk", "0.75, 0.75, 0.75")) +
               constant_light("sky", "0.4, 0.5, 0.7") +
               obj_shape("object", write_mesh(files, "cube.obj", cube_mesh()), true, 0.6,
                         {0, 0.9, 0}, diffuse("clay", "0.7, 0.5, 0.3"));
  Scene scene = make_scene(files, parts);
  scene.camera.near_clip = 3;
  const GradientResult ours = run_blocks(scene, {"sensor.translate.z"}, 128, 1);
  GradientOptions differences;
  differences.parameters = {"sensor.translate.z"};
  differences.method = "fd";
  differences.step = 0.01;
  RunSettings settings;
  settings.spp = 1024;
  const Moments reference = gradient(scene, differences, settings).parameters[0].image_sum;
  const Moments& sum = ours.parameters[0].image_sum;
  fmt::print("{} +- {}, differences {} +- {}\n", sum.mean(0), std::sqrt(sum.variance(0)),
             reference.mean(0), std::sqrt(reference.variance(0)));
  EXPECT_TRUE(compare_moments(sum, reference).plausible(kLevel));
}

// A camera on a face that its near plane, at hardly any distance, cuts: points at a depth of zero
// are nowhere on the film.
TEST(NearPlane, AtThePinhole) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 3;
  parts.origin = {0, 0, 1};
  parts.target = {-0.0023310243223409574, -0.20563730207678144, 0.04731135851762731};
  parts.body = constant_light("sky", "0.4, 0.5, 0.7") +
               obj_shape("object", write_mesh(files, "cube.obj", cube_mesh()), true, 1, {},
                         diffuse("clay", "0.7, 0.5, 0.3"));
  Scene scene = make_scene(files, parts);
  scene.camera.near_clip = 1e-30;
  run_blocks(scene, {"object.scale", "sensor.translate.y"}, 4, 1);  // all samples are finite
}

// Two shapes in one place.
class Copies : public testing::Test {
 protected:
  static Scene scene(bool copy) {
    const TempFiles files;
    SceneParts parts;
    parts.origin = {0.6, 1.8, 3.4};
    parts.body = diffuse("clay", "0.7, 0.5, 0.3") + constant_light("sky", "0.4, 0.5, 0.7") +
                 square("floor", 3, -90, {}, diffuse("chalk", "0.75, 0.75, 0.75")) +
                 square("lamp", 0.5, 90, {0.3, 2.6, 0.5}, area_light("glow", "6, 5, 4"));
    const std::string file = write_mesh(files, "cube.obj", cube_mesh());
    const std::string clay = "<ref id=\"clay\"/>";
    parts.body += obj_shape("object", file, true, 0.5, {0, 0.9, 0}, clay);
    if (copy) parts.body += obj_shape("again", file, true, 0.5, {0, 0.9, 0}, clay);
    return make_scene(files, parts);
  }
};

TEST_F(Copies, ShadowNothing) {
  RunSettings settings;
  settings.spp = 64;
  // The same rays meet the same faces: not even rounding differs.
  EXPECT_EQ(means(render(scene(true), settings).radiance),
            means(render(scene(false), settings).radiance));
}

TEST_F(Copies, MoveWithTheCamera) {
  const auto two = run_blocks(scene(true), {"sensor.translate.x"}, 128, 1);
  const auto one = run_blocks(scene(false), {"sensor.translate.x"}, 128, 2);
  EXPECT_TRUE(compare_moments(two.parameters[0].total_blocks, one.parameters[0].total_blocks)
                  .plausible(kLevel));
  EXPECT_TRUE(
      compare_moments(two.parameters[0].image_sum, one.parameters[0].image_sum).plausible(kLevel));
}

TEST_F(Copies, MoveTogether) {
  // As each moves alone the image has a kink; the two sum to what both come to.
  for (const char* motion : {"translate.x", "translate.y", "rotate.y"}) {
    const auto two = run_blocks(
        scene(true), {std::string("object.") + motion, std::string("again.") + motion}, 64, 1);
    const auto one = run_blocks(scene(false), {std::string("object.") + motion}, 64, 2);
    const auto& [a, b] = std::tie(two.parameters[0].image_sum, two.parameters[1].image_sum);
    const Moments& both = one.parameters[0].image_sum;
    // Of one run: their errors add at most.
    const double error = std::sqrt(a.variance(0)) + std::sqrt(b.variance(0));
    const double residual = a.mean(0) + b.mean(0) - both.mean(0);
    fmt::print("{}: {} + {} against {}\n", motion, a.mean(0), b.mean(0), both.mean(0));
    EXPECT_LT(std::fabs(residual), 4 * std::hypot(error, std::sqrt(both.variance(0)))) << motion;
  }
}

// Where both pass through a third shape, the line of that counts once.
TEST_F(Copies, PassThroughOthers) {
  const auto found = [](bool copy, const std::vector<std::string>& parameters, uint64_t seed) {
    const TempFiles files;
    SceneParts parts;
    parts.body = constant_light("sky", "0.4, 0.5, 0.7") +
                 obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), true, 0.7,
                           {0.1, 0.5, 0}, diffuse("clay", "0.7, 0.2, 0.1"));
    for (const char* name : {"plate", "again"}) {
      if (!copy && name == std::string("again")) break;
      parts.body += square(name, 1.5, -80, {0, 0.4, 0}, "<ref id=\"chalk\"/>");
    }
    parts.body +=
        "<bsdf type=\"twosided\" id=\"chalk\">" + diffuse("white", "0.8, 0.9, 0.8") + "</bsdf>";
    return run_blocks(make_scene(files, parts), parameters, 256, seed).parameters;
  };
  expect_equal(found(true, {"ball.translate.y"}, 1)[0], found(false, {"ball.translate.y"}, 2)[0]);
  const auto two = found(true, {"plate.translate.y", "again.translate.y"}, 3);
  const Moments one = found(false, {"plate.translate.y"}, 4)[0].image_sum;
  const auto& [a, b] = std::tie(two[0].image_sum, two[1].image_sum);
  const double error = std::sqrt(a.variance(0)) + std::sqrt(b.variance(0));
  fmt::print("{} + {} against {}\n", a.mean(0), b.mean(0), one.mean(0));
  EXPECT_LT(std::fabs(a.mean(0) + b.mean(0) - one.mean(0)),
            4 * std::hypot(error, std::sqrt(one.variance(0))));
}

TEST_F(Copies, AreWarnedOf) {
  const TempFiles files;
  SceneParts parts;
  parts.body =
      square("one", 1, 0, {}, "") + square("two", 1, 0, {}, "") + square("behind", 1, 180, {}, "");
  std::vector<std::string> warnings;
  read_scene(files.write("scene.xml", scene_text(parts)), {}, &warnings);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("2 faces of \"two\" coincide with faces of \"one\""),
            std::string::npos)
      << warnings[0];
}

// Only one of two lamps is seen, and only one shines.
TEST_F(Copies, OfLamps) {
  const auto image = [](int lamps, uint64_t seed) {
    const TempFiles files;
    SceneParts parts;
    parts.body = square("floor", 3, -90, {}, diffuse("chalk", "0.75, 0.75, 0.75"));
    for (int i = 0; i < lamps; ++i) {
      parts.body += square("lamp" + std::to_string(i), 1.5, 90, {0, 1.5, 0},
                           area_light("glow" + std::to_string(i), "6, 5, 4"));
    }
    RunSettings settings;
    settings.spp = 256;
    settings.seed = seed;
    return render(make_scene(files, parts), settings).radiance;
  };
  EXPECT_TRUE(compare_moments(image(2, 1), image(1, 2)).plausible(kLevel));
}

// Two one-sided faces back to back: each side shows its own.
TEST_F(Copies, OfBothSides) {
  for (const double side : {1.0, -1.0}) {
    const TempFiles files;
    SceneParts parts;
    parts.max_depth = 1;
    parts.width = parts.height = 4;
    parts.origin = {0.1, 0.2, 4 * side};
    parts.target = {0, 0, 0};
    const std::string front = write_mesh(files, "front.obj", grid_mesh(1));
    const std::string back = write_mesh(files, "back.obj", reversed(grid_mesh(1)));
    parts.body = obj_shape("front", front, true, 10, {}, area_light("a", "1, 1, 1")) +
                 obj_shape("back", back, true, 10, {}, area_light("b", "3, 3, 3"));
    RunSettings settings;
    for (const double value : means(render(make_scene(files, parts), settings).radiance))
      EXPECT_EQ(value, side > 0 ? 1 : 3);
  }
}

// Two tiles that overlap in a plane which no axis is in, seen head on: "first" is [-1, 1] by [-1,
// 1] in coordinates of the plane, "second" [0, 2] by [-1/2, 1/2]. The film is 6 wide there.
class OverlappingTiles : public testing::Test {
 protected:
  static constexpr int kPixels = 24;
  static inline const Vec3d kRows[3] = {{0.6, -0.48, 0.64}, {0.8, 0.36, -0.48}, {0, 0.8, 0.6}};
  static inline const Vec3d kOffset{0.37, 1.21, -0.53};

  static Vec3d turned(const Vec3d& x) {
    return {dot(kRows[0], x), dot(kRows[1], x), dot(kRows[2], x)};
  }
  static std::string tile(const std::string& id, double from, double to, double half,
                          const std::string& inner) {
    const auto at = [&](double x, double y) { return cast<float>(Vec3d{x, y, 0}); };
    const Mesh mesh = make_mesh({at(from, -half), at(to, -half), at(to, half), at(from, half)},
                                {{0, 1, 2}, {0, 2, 3}});
    return obj_shape(id, write_mesh(files(), id + ".obj", transformed(mesh, kRows, 1, kOffset)),
                     true, 1, {}, inner);
  }
  static std::string first(const std::string& inner) { return tile("first", -1, 1, 1, inner); }
  static std::string second(const std::string& inner, double from = 0) {
    return tile("second", from, 2, 0.5, inner);
  }
  static SceneParts parts(int max_depth, const std::string& body) {
    SceneParts parts;
    parts.max_depth = max_depth;
    parts.origin = turned({0, 0, 3}) + kOffset;
    parts.target = kOffset;
    parts.fov = 90;
    parts.width = parts.height = kPixels;
    parts.body = body;
    return parts;
  }
  static Scene scene(int max_depth, const std::string& body) {
    return make_scene(files(), parts(max_depth, body));
  }
  static const TempFiles& files() {
    static const TempFiles files;
    return files;
  }
};

TEST_F(OverlappingTiles, ShowTheFirst) {
  // Where the earlier one of the file is all that a pixel can see, the other one might as well not
  // be there: not a bit differs.
  const std::string red = diffuse("red", "0.8, 0.2, 0.1"), blue = diffuse("blue", "0.1, 0.2, 0.8");
  const std::string lights =
      constant_light("sky", "0.4, 0.5, 0.7") +
      square("lamp", 0.5, 90, turned({0, 0.3, 1.5}) + kOffset, area_light("glow", "6, 5, 4"));
  RunSettings settings;
  settings.spp = 16;
  const auto image = [&](int max_depth, const std::string& body) {
    return means(render(scene(max_depth, body), settings).radiance);
  };
  const std::string glow = area_light("one", "1, 1, 1");
  const auto in_first = image(1, first(glow)), in_second = image(1, second(glow));
  const auto one = image(3, lights + first(red)), two = image(3, lights + second(blue));
  const auto red_first = image(3, lights + first(red) + second(blue));
  const auto blue_first = image(3, lights + second(blue) + first(red));
  int common = 0;
  for (size_t i = 0; i < one.size(); ++i) {
    if (in_first[i] == 1) {
      EXPECT_EQ(red_first[i], one[i]) << i;
    }
    if (in_second[i] == 1) {
      EXPECT_EQ(blue_first[i], two[i]) << i;
    }
    common += in_first[i] == 1 && in_second[i] == 1;
  }
  EXPECT_GE(common, 3 * 4);  // of 16 pixels that the overlap covers
}

TEST_F(OverlappingTiles, GlowAsTheFirst) {
  // The picture has the flux L_1 4 + L_2 (2 - A), with A = 1 the area of the overlap, which grows
  // by 1 as the first moves along the plane's x, and does not change along its y.
  std::string motions[2];
  for (int axis = 0; axis < 2; ++axis) {
    std::string lines;
    const Vec3d v = turned(axis == 0 ? Vec3d{1, 0, 0} : Vec3d{0, 1, 0});
    for (int i = 0; i < 4; ++i) lines += fmt::format("{} {} {}\n", v.x, v.y, v.z);
    motions[axis] = ".vertex_positions:" + files().write(fmt::format("v{}.txt", axis), lines);
  }
  const Scene glowing =
      scene(1, first(area_light("a", "1, 1, 1")) + second(area_light("b", "3, 3, 3")));
  const double pixels = 3 * std::pow(kPixels / 6.0, 2);  // of one area, for three channels
  const GradientResult result = run_blocks(
      glowing, {"first" + motions[0], "second" + motions[0], "first" + motions[1]}, 64, 1);
  const double exact[] = {-3, 3, 0};
  for (int i = 0; i < 3; ++i) {
    const Moments& sum = result.parameters[i].image_sum;
    fmt::print("{} +- {}, exact {}\n", sum.mean(0), std::sqrt(sum.variance(0)), exact[i] * pixels);
    // The jump is the same all along each edge: there is hardly any noise. Lengths of up to 4 are
    // off by the rounding of positions, a few times 4 * 2^-24 of them.
    EXPECT_NEAR(sum.mean(0), exact[i] * pixels, 5 * std::sqrt(sum.variance(0)) + 0x1p-20 * pixels);
  }
}

TEST_F(OverlappingTiles, LightAsCutTilesDo) {
  // Against a second tile that begins where the first one ends.
  const std::string grey = "<bsdf type=\"diffuse\"/>";
  const auto both = [&](double from) {
    return scene(3, square("floor", 4, -90, {0, -1, 0}, diffuse("chalk", "0.75, 0.75, 0.75")) +
                        first(grey + area_light("a", "9, 3, 1")) +
                        second(grey + area_light("b", "1, 3, 9"), from));
  };
  const auto a = run_blocks(both(0), {"sensor.translate.x", "floor.translate.y"}, 32, 1);
  const auto b = run_blocks(both(1), {"sensor.translate.x", "floor.translate.y"}, 32, 2);
  EXPECT_TRUE(compare_moments(a.radiance, b.radiance).plausible(kLevel));
  for (int i = 0; i < 2; ++i) {
    EXPECT_TRUE(compare_moments(a.parameters[i].total_blocks, b.parameters[i].total_blocks)
                    .plausible(kLevel));
    fmt::print("{} {}\n", a.parameters[i].image_sum.mean(0), b.parameters[i].image_sum.mean(0));
  }
}

TEST_F(OverlappingTiles, AreWarnedOfWhereTheyFaceTheSameWay) {
  const auto warnings = [](const std::string& body) {
    std::vector<std::string> lines;
    read_scene(files().write("warned.xml", scene_text(parts(1, body))), {}, &lines);
    return lines;
  };
  const auto lines = warnings(first("") + second(""));
  ASSERT_EQ(lines.size(), 1u);
  EXPECT_NE(lines[0].find("pairs of faces of \"first\" and \"second\" overlap in a plane: those "
                          "of \"first\" are visible there"),
            std::string::npos)
      << lines[0];
  EXPECT_NE(warnings(first("") + second(area_light("b", "1, 1, 1")))[0].find("those of \"second\""),
            std::string::npos);
  EXPECT_EQ(warnings(first("") + second("", 1)).size(), 0u);
  // A box on a floor.
  EXPECT_EQ(warnings(square("floor", 4, -90, {}, "") + square("bottom", 1, 90, {}, "")).size(), 0u);
}

// A face of width 1e-23 at a distance of 1 from the origin changes nothing.
TEST(Needle, IsNotSeen) {
  const auto sums = [](const std::string& needle) {
    const TempFiles files;
    SceneParts parts;
    parts.max_depth = 5;
    parts.width = parts.height = 4;
    parts.origin = {0.6, 1.8, 3.4};
    const std::string file =
        files.write("needle.obj",
                    "v -1e-20 0 0\nv 0 1e-3 0.3\nv 0 0 0\nv 100 0 0\nv 0 100 0\n"
                    "f 3 4 5\n" +
                        needle);
    parts.body = square("floor", 3, -90, {}, conductor("gloss", 0.05)) +
                 square("lamp", 1e-4, 90, {0.3, 2.6, 0.5}, area_light("glow", "1e6, 1e6, 1e6")) +
                 constant_light("sky", "0.4, 0.5, 0.7") +
                 obj_shape("object", file, false, 1e-3, {0, 1, 0},
                           "<bsdf type=\"twosided\"><bsdf type=\"diffuse\"/></bsdf>");
    return means(
        run_blocks(make_scene(files, parts), {"object.translate.x"}, 16, 0).parameters[0].total);
  };
  EXPECT_EQ(sums("f 2 1 3\n"), sums(""));
}

}  // namespace
}  // namespace limn
