// Viewpoints where the derivative has a kink: the camera or a light in the plane of a face, shadows
// that end along an edge, things that stand on others. What is computed is the derivative a step
// aside.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "integrators/terms/camera_edges.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/statistics.h"
#include "support/block_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// Where the camera or a light lies in the plane of a face, both borders of the face are one line,
// and the derivative is that of a place beside it from where the face is not seen.
struct EdgeOn {
  std::string name;
  std::string parameter;
  // Scenes as they are with the viewpoint in the plane of a face, and so far beside it.
  std::function<Scene(const TempFiles&, double beside)> scene;
};

std::string sun(const Vec3d& d) {
  return fmt::format(
      R"(<emitter type="directional"><vector name="direction" value="{},{},{}"/>
         <rgb name="irradiance" value="2,2,2"/></emitter>)",
      d.x, d.y, d.z);
}
std::string bulb(const Vec3d& p) {
  return fmt::format(
      R"(<emitter type="point"><point name="position" value="{},{},{}"/>
         <rgb name="intensity" value="9,9,9"/></emitter>)",
      p.x, p.y, p.z);
}

Scene scene_of(const TempFiles& files, double x, int max_depth, const std::string& body) {
  SceneParts parts;
  parts.max_depth = max_depth;
  parts.origin = {x, 2.3, 4};
  parts.target = {0.1, 0.4, 0};
  parts.body = body;
  return make_scene(files, parts);
}

// [-0.5, 0.5] x [0.25, 1.25] x [-0.5, 0.5].
std::string box(const TempFiles& files, const std::string& inner) {
  return obj_shape("box", write_mesh(files, "box.obj", cube_mesh()), true, 0.5, {0, 0.75, 0},
                   inner);
}
std::string box_over_floor(const TempFiles& files) {
  return box(files, diffuse("clay", "0.5, 0.5, 0.5")) +
         square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8"));
}

std::vector<EdgeOn> edge_on_cases() {
  const auto glowing_box = [](const TempFiles& files, double beside) {
    return scene_of(files, 0.5 - beside, 1, box(files, area_light("glow", "1, 1, 1")));
  };
  // The front and the right side of a box, and a plate behind them that ends in the same plane.
  const auto plates = [](const TempFiles& files, double beside) {
    const auto plate = [&](const std::string& id, const Mesh& mesh, const std::string& glow) {
      return obj_shape(id, write_mesh(files, id + ".obj", mesh), true, 1, {},
                       area_light(id + "glow", glow));
    };
    const auto quad = [](const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d) {
      return make_mesh({a, b, c, d}, {{0, 1, 2}, {0, 2, 3}});
    };
    return scene_of(
        files, 0.5 - beside, 1,
        plate("front", quad({-.5f, 0, .5f}, {.5f, 0, .5f}, {.5f, 1, .5f}, {-.5f, 1, .5f}),
              "1,1,1") +
            plate("right", quad({.5f, 0, .5f}, {.5f, 0, -1}, {.5f, 1, -1}, {.5f, 1, .5f}),
                  "3,3,3") +
            plate("back", quad({-.5f, 0, -1}, {.5f, 0, -1}, {.5f, 1, -1}, {-.5f, 1, -1}), "2,2,2"));
  };
  const auto under_sun = [](const TempFiles& files, double beside) {
    return scene_of(files, 0.3, 2, box_over_floor(files) + sun({beside, -1, 0.7 * beside}));
  };
  const auto under_bulb = [](const TempFiles& files, double beside) {
    return scene_of(files, 0.3, 2, box_over_floor(files) + bulb({0.5 - beside, 2.5, 0.2}));
  };
  // Its side begins to be lit as the light moves on.
  const auto lit_side = [](const TempFiles& files, double beside) {
    return scene_of(files, 3, 2,
                    box(files, diffuse("clay", "0.5, 0.5, 0.5")) + bulb({0.5 - beside, 2.5, 0.2}));
  };
  // Turning, this sun lights the upright face or not, and its shadow ends at its upper edge or at
  // its lower one.
  const auto wedge = [](const TempFiles& files, double beside) {
    const Mesh mesh = make_mesh(
        {{-.5f, 0, .5f},
         {.5f, 0, .5f},
         {.5f, 1, .5f},
         {-.5f, 0, -.5f},
         {.5f, 0, -.5f},
         {.5f, 1, -.5f}},
        {{0, 1, 2}, {3, 5, 4}, {0, 3, 4}, {0, 4, 1}, {1, 4, 5}, {1, 5, 2}, {0, 2, 5}, {0, 5, 3}});
    std::string light = sun({beside, -1, 0.3});
    light.insert(light.find('>'), " id=\"sun\"");
    return scene_of(files, 3, 2,
                    obj_shape("wedge", write_mesh(files, "wedge.obj", mesh), true, 1, {0, 0.3, 0},
                              diffuse("clay", "0.5, 0.5, 0.5")) +
                        square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
                        light);
  };
  return {{"Camera", "sensor.translate.x", glowing_box},
          {"CameraAndBox", "box.translate.x", glowing_box},
          {"CameraAndPlates", "sensor.translate.x", plates},
          {"SunAlong", "box.translate.x", under_sun},
          {"SunAcross", "box.translate.z", under_sun},
          {"Bulb", "box.translate.x", under_bulb},
          {"BulbAtSide", "box.translate.x", lit_side},
          {"SunTurns", "sun.rotate.z", wedge}};
}

class FacesEdgeOn : public testing::TestWithParam<EdgeOn> {};

TEST_P(FacesEdgeOn, AreNotThere) {
  const TempFiles files;
  const auto sum_at = [&](double beside) {
    return run_blocks(GetParam().scene(files, beside), {GetParam().parameter}, 256,
                      beside == 0 ? 1 : 2)
        .parameters[0]
        .image_sum;
  };
  const Moments at = sum_at(0), beside = sum_at(2e-4);
  fmt::print("{} +- {}, beside {} +- {}\n", at.mean(0), std::sqrt(at.variance(0)), beside.mean(0),
             std::sqrt(beside.variance(0)));
  EXPECT_TRUE(compare_moments(at, beside).plausible(kLevel));
}

INSTANTIATE_TEST_SUITE_P(, FacesEdgeOn, testing::ValuesIn(edge_on_cases()),
                         [](const auto& c) { return c.param.name; });

// A kink only where the parameter moves the viewpoint and the plane past each other.
TEST(FacesEdgeOnKink, IsOfMotionAcrossThePlane) {
  const TempFiles files;
  const auto at_kink = [&](double x, const Vec3d& direction, const std::string& parameter) {
    const std::string light =
        sun(direction) + square("screen", 0.3, 50, {1.5, 0.7, 0.6}, "<ref id=\"chalk\"/>");
    return run_blocks(scene_of(files, x, 2, box_over_floor(files) + light), {parameter}, 1, 0)
        .at_kink;
  };
  const Vec3d slanted{0.1, -1, 0.2}, straight{0, -1, 0};
  for (const char* parameter : {"box.translate.x", "sensor.translate.x", "box.rotate.y"}) {
    EXPECT_TRUE(at_kink(0.5, slanted, parameter)) << parameter;
    EXPECT_FALSE(at_kink(0.3, slanted, parameter)) << parameter;
  }
  for (const char* parameter : {"box.translate.y", "sensor.translate.z", "sensor.rotate.y",
                                "screen.translate.x", "floor.translate.x"}) {
    EXPECT_FALSE(at_kink(0.5, slanted, parameter)) << parameter;
  }
  // From infinity nothing but turning crosses a plane.
  EXPECT_TRUE(at_kink(0.3, straight, "box.rotate.z"));
  EXPECT_FALSE(at_kink(0.3, straight, "box.translate.x"));
  EXPECT_FALSE(at_kink(0.3, straight, "box.rotate.y"));
}

TEST(FacesEdgeOnWarning, NamesTheViewpoint) {
  const TempFiles files;
  const auto warnings = [&](double x, const Vec3d& direction) {
    return run_blocks(scene_of(files, x, 2, box_over_floor(files) + sun(direction)),
                      {"box.translate.x"}, 1, 0)
        .warnings;
  };
  EXPECT_TRUE(warnings(0.3, {0.1, -1, 0.2}).empty());
  const auto found = warnings(0.5, {0, -1, 0});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NE(
      found[0].find("the camera lies in the plane of faces (2 of them, the first of \"box\")"),
      std::string::npos)
      << found[0];
  EXPECT_NE(
      found[1].find("directional along (0, -1, 0), irradiance 2 2 2 lies in the plane of faces (8"),
      std::string::npos)
      << found[1];
}

// Where the shadow of a plate ends along an edge of what it falls on, or out of sight behind the
// plate, or the camera sees edges in one line, and the same with the light or the camera so far
// beside, on the side that counts.
struct AlongEdge {
  std::string name;
  std::vector<std::string> parameters;
  std::function<Scene(const TempFiles&, double beside)> scene;
};

constexpr Vec3d kSide{0.3701, 0.7851, 0.4967};  // Viewpoint's

// A light that shines through y on x, from the height h.
std::string bulb_through(double h, const Vec3d& y, const Vec3d& x, double beside) {
  std::string light = bulb(x + (y - x) * (h / (y.y - x.y)) + kSide * beside);
  light.insert(light.find('>'), " id=\"bulb\"");
  return light;
}

std::vector<AlongEdge> along_edge_cases() {
  const auto seen_from = [](const TempFiles& files, const Vec3d& origin, const std::string& body) {
    SceneParts parts;
    parts.max_depth = 2;
    parts.origin = origin;
    parts.target = {0.1, 0.3, 0};
    parts.body = body;
    return make_scene(files, parts);
  };
  const auto plate = [](double z, double height) {
    return square("plate", 0.5, -90, {0, height, z}, diffuse("black", "0, 0, 0"));
  };
  const auto floor = [](double size) {
    return square("floor", size, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8"));
  };
  const Vec3d high{0.3, 2.3, 4}, low{0.3, 0.6, 4};
  // Up to the border, and from the border on.
  const auto border = [=](double z, double height) {
    return [=](const TempFiles& files, double beside) {
      const Vec3d y{0, height, 1 - height};
      return seen_from(files, high,
                       floor(1) + plate(y.z + z, height) + bulb_through(1.5, y, {0, 0, 1}, beside));
    };
  };
  const auto wall = [=](const TempFiles& files, double beside) {
    return seen_from(files, high,
                     floor(1) + plate(0, 0.5) +
                         square("wall", 1, 0, {0, 1, -1}, diffuse("paint", "0.3, 0.5, 0.6")) +
                         bulb_through(1.5, {0, 0.5, -0.5}, {0, 0, -1}, beside));
  };
  const auto step = [=](const Vec3d& origin) {
    return [=](const TempFiles& files, double beside) {
      return seen_from(files, origin,
                       floor(3) +
                           obj_shape("step", write_mesh(files, "step.obj", cube_mesh()), true, 0.5,
                                     {0, 0.5, 0}, diffuse("clay", "0.5, 0.5, 0.5")) +
                           plate(0.125, 1.25) +
                           bulb_through(1, {0, 1.25, 0.625}, {0, 1, 0.5}, beside));
    };
  };
  const auto under_sun = [=](const TempFiles& files, double beside) {
    std::string light = sun(Vec3d{0.2, -1, 0.5} - kSide * beside);
    light.insert(light.find('>'), " id=\"sun\"");
    return seen_from(files, high, floor(1) + plate(0.25, 0.5) + light);
  };
  const auto flash = [=](const TempFiles& files, double beside) {
    return seen_from(files, high, floor(3) + plate(0, 0.5) + bulb(high + kSide * beside));
  };
  const auto stack = [=](const TempFiles& files, double beside) {
    return seen_from(files, high,
                     floor(3) + plate(0, 0.5) +
                         square("upper", 0.5, -90, {0.2, 1, -0.5}, "<ref id=\"black\"/>") +
                         bulb_through(1.5, {0, 0.5, 0.5}, {0, 0, 1}, beside));
  };
  const auto rims = [=](const TempFiles& files, double beside) {
    const auto sheet = [](const std::string& id, double z) {
      return square(id, 0.5, 0, {0, 0.5, z}, diffuse(id + "_paint", "0.6, 0.4, 0.5"));
    };
    return seen_from(files, Vec3d{0.3, 1, 4} + kSide * beside,
                     sheet("front", 0.5) + sheet("back", -1) + floor(3) +
                         constant_light("sky", "0.4, 0.5, 0.7"));
  };
  // Nearer than the other one the first sheet ends where the second, above the camera, begins.
  const auto sign = [=](const TempFiles& files, double beside) {
    const auto sheet = [](const std::string& id, double y, double z) {
      return square(id, 0.5, 0, {0, y, z}, diffuse(id + "_paint", "0.6, 0.4, 0.5"));
    };
    return seen_from(files, Vec3d{0.3, 1, 4} + kSide * beside,
                     sheet("front", 0.5, 0.5) + sheet("back", 1.5, -1) + floor(3) +
                         constant_light("sky", "0.4, 0.5, 0.7"));
  };
  return {{"Rims", {"sensor.translate.y", "front.translate.y", "back.translate.y"}, rims},
          {"Sign", {"sensor.translate.y", "front.translate.y", "back.translate.y"}, sign},
          {"Border", {"plate.translate.z", "sensor.translate.z"}, border(-0.5, 0.5)},
          {"BorderOn", {"plate.translate.z", "bulb.translate.y"}, border(0.5, 0.5)},
          {"BorderNear", {"plate.translate.z", "floor.translate.y"}, border(-0.5, 0.02)},
          {"Wall", {"plate.translate.z", "wall.translate.z"}, wall},
          {"Step", {"plate.translate.z", "step.translate.z"}, step(high)},
          {"StepSeenFromBelow", {"plate.translate.z", "step.translate.z"}, step(low)},
          {"Sun", {"plate.translate.z", "sun.rotate.x"}, under_sun},
          {"Flash", {"plate.translate.x", "sensor.translate.x"}, flash},
          {"Stack", {"plate.translate.z", "upper.translate.z"}, stack}};
}

class AlongEdges : public testing::TestWithParam<AlongEdge> {};

TEST_P(AlongEdges, AsFromBeside) {
  const TempFiles files;
  const auto run = [&](double beside) {
    GradientOptions options;
    options.parameters = GetParam().parameters;
    return run_blocks(GetParam().scene(files, beside), options, 256, beside == 0 ? 1 : 2);
  };
  const GradientResult at = run(0), beside = run(2e-4);
  for (size_t p = 0; p < at.parameters.size(); ++p)
    expect_equal(at.parameters[p], beside.parameters[p]);
}

TEST_P(AlongEdges, InReverse) {
  const TempFiles files;
  BackwardOptions options;
  options.parameters = GetParam().parameters;
  RunSettings settings;
  settings.spp = 64;
  settings.threads = 1;
  for (const ReverseCheck& c : check_reverse(GetParam().scene(files, 0), options, settings)) {
    fmt::print("{}: {:g} +- {:.2g}, {:g} +- {:.2g}\n", c.parameter, c.forward, c.forward_error,
               c.reverse, c.reverse_error);
    EXPECT_GT(normal_p_value(c.z), kLevel / 20);
  }
}

INSTANTIATE_TEST_SUITE_P(, AlongEdges, testing::ValuesIn(along_edge_cases()),
                         [](const auto& c) { return c.param.name; });

// Edges that the camera sees in one line and that move past each other are told of, as long as
// they do, and as they are seen.
TEST(EdgesInLine, AreToldOf) {
  const TempFiles files;
  const auto cases = along_edge_cases();
  const auto& sign_scene = std::find_if(cases.begin(), cases.end(), [](const auto& c) {
                             return c.name == "Sign";
                           })->scene;
  const auto run = [&](const std::string& parameter, double beside) {
    GradientOptions options;
    options.parameters = {parameter};
    return run_blocks(sign_scene(files, beside), options, 1, 0);
  };
  for (const char* parameter : {"sensor.translate.y", "back.translate.y", "back.rotate.z"}) {
    const GradientResult r = run(parameter, 0);
    EXPECT_TRUE(r.at_kink) << parameter;
    ASSERT_EQ(r.warnings.size(), 1u) << parameter;
    EXPECT_NE(r.warnings[0].find("edges of \"front\" and \"back\" in one line"), std::string::npos)
        << r.warnings[0];
    EXPECT_FALSE(run(parameter, 2e-4).at_kink) << parameter;
  }
  for (const char* parameter : {"sensor.translate.z", "sensor.rotate.x", "back.translate.x"}) {
    const GradientResult r = run(parameter, 0);
    EXPECT_FALSE(r.at_kink) << parameter;
    EXPECT_TRUE(r.warnings.empty()) << parameter;
  }
}

// Rims of many short edges behind each other, which seen so lie in one oblique line.
TEST(EdgesInLine, AreFoundHoweverShort) {
  const auto rim = [](int count, double depth, double shift) {
    std::vector<FilmEdge> edges(count);
    const Vec3d from{13, 200, 0}, along = normalize(Vec3d{0.8, -0.6, 0});
    for (int k = 0; k < count; ++k) {
      const auto at = [&](int i) {
        const Vec3d x = from + along * (100 * depth * i / count + shift);
        // As floats round them.
        return Vec3d{static_cast<float>(x.x), static_cast<float>(x.y), 0};
      };
      const Vec3d a = at(k), b = at(k + 1);
      FilmEdge& e = edges[k];
      e.x0 = a.x, e.y0 = a.y, e.x1 = b.x, e.y1 = b.y;
      e.length = length(b - a);
      e.nx = (b.y - a.y) / e.length, e.ny = -(b.x - a.x) / e.length;
      e.depth0 = e.depth1 = depth;
      e.shape = ShapeId(static_cast<uint32_t>(depth));
    }
    return edges;
  };
  Camera camera;
  camera.width = camera.height = 256;
  for (const int count : {1, 32, 1024, 30000}) {
    std::vector<FilmEdge> moving = rim(count, 2, 0);
    const std::vector<FilmEdge> behind = rim(count, 3, -0.37), beside = rim(8, 2, 300);
    const std::vector<FilmLine> resting(behind.begin(), behind.end());
    moving.insert(moving.end(), beside.begin(), beside.end());
    const EdgesInLine found = find_edges_in_line(moving, resting, camera);
    ASSERT_EQ(found.in_line.size(), moving.size());
    const auto in_line = std::count(found.in_line.begin(), found.in_line.end(), true);
    EXPECT_EQ(in_line, count) << count;
    EXPECT_FALSE(found.parting);
  }
}

// A thing that stands on a floor ends where it touches it. Pressed together or drawn apart they
// have one slope and another; what is computed is the one of things pressed together, as they are
// where the thing stands a little deeper.
struct Standing {
  std::string name;
  std::function<std::string(const TempFiles&)> mesh;  // its file; its lowest points are at 0
  std::string light;
  // kBox: of the same width as the thing. kTurned: wound the other way, with both sides matt, as
  // kBelow is, which is seen from below.
  enum { kMatt, kGlossy, kBox, kTurned, kBelow } floor = kMatt;
  bool analytic = false;  // light in closed form
};

std::vector<Standing> standing_cases() {
  const auto cube = [](const TempFiles& files) {
    Mesh mesh = cube_mesh();
    for (Vec3f& x : mesh.positions) x.y += 1;
    return write_mesh(files, "thing.obj", mesh);
  };
  const auto roof = [](const TempFiles& files) {  // with slanted sides
    return write_mesh(
        files, "thing.obj",
        make_mesh({{-1, 0, -1}, {1, 0, -1}, {1, 0, 1}, {-1, 0, 1}, {0.2f, 2, 0}},
                  {{0, 1, 2}, {0, 2, 3}, {1, 0, 4}, {2, 1, 4}, {3, 2, 4}, {0, 3, 4}}));
  };
  const auto screen = [](const TempFiles& files) {  // one sheet
    return write_mesh(files, "thing.obj",
                      make_mesh({{-1, 0, 0.3f}, {1, 0, -0.3f}, {1, 2, -0.3f}, {-1, 2, 0.3f}},
                                {{0, 1, 2}, {0, 2, 3}}));
  };
  // Half sunk: with edges in the floor, and faces above and under it.
  const auto diamond = [](const TempFiles& files) {
    Mesh mesh = cube_mesh();
    for (Vec3f& x : mesh.positions) x = {1.2f * x.x + 0.4f * x.z, x.y - x.z, x.y + x.z};
    return write_mesh(files, "thing.obj", mesh);
  };
  const std::string sky = constant_light("sky", "0.4, 0.5, 0.7");
  const std::string lamp = square("lamp", 0.5, 90, {0.9, 2.6, 1.5}, area_light("glow", "6, 5, 4"));
  return {{"BoxUnderSun", cube, sun({0.3, -1, -0.2})},
          {"BoxUnderLamp", cube, lamp},
          {"BoxInClosedForm", cube, lamp, Standing::kMatt, true},
          {"BoxOnGloss", cube, sky, Standing::kGlossy},
          {"BoxOnBox", cube, sun({0.3, -1, -0.45}), Standing::kBox},
          {"RoofUnderSky", roof, sky},
          {"HalfSunkUnderSky", diamond, sky},
          {"HalfSunkUnderSun", diamond, sun({0.3, -1, -0.2})},
          {"HalfSunkInTurnedFloor", diamond, sky, Standing::kTurned},
          {"HalfSunkSeenFromBelow", diamond, sky, Standing::kBelow},
          {"RoofOnTurnedFloor", roof, sky, Standing::kTurned},
          {"ScreenUnderBulb", screen, bulb({0.7, 2, 1.6})}};
}

class StandsOnAFloor : public testing::TestWithParam<Standing> {
 protected:
  // depth: of the thing's lowest points under the floor, as it is seen.
  Scene scene(double depth) const {
    const TempFiles files;
    const Standing& c = GetParam();
    SceneParts parts;
    parts.origin = {0.6, 1.8, 3.4};
    parts.target = {0, 0.3, 0};
    if (c.analytic) parts.max_depth = 2;
    if (c.floor == Standing::kBelow) {
      parts.origin.y = -parts.origin.y;
      depth = -depth;
    }
    const std::string chalk = diffuse("chalk", "0.8, 0.8, 0.8");
    const std::string both_sides = "<bsdf type=\"twosided\">" + chalk + "</bsdf>";
    const std::string square_floor =
        c.floor == Standing::kGlossy   ? square("floor", 2, -90, {0, 0, 0}, conductor("gloss", 0.3))
        : c.floor == Standing::kTurned ? square("floor", 2, 90, {0, 0, 0}, both_sides)
        : c.floor == Standing::kBelow  ? square("floor", 2, -90, {0, 0, 0}, both_sides)
                                       : square("floor", 2, -90, {0, 0, 0}, chalk);
    parts.body =
        c.light +
        obj_shape("thing", c.mesh(files), true, 0.4, {0, -depth, 0},
                  "<bsdf type=\"twosided\">" + diffuse("clay", "0.5, 0.5, 0.5") + "</bsdf>") +
        (c.floor == Standing::kBox ? obj_shape("floor", write_mesh(files, "floor.obj", cube_mesh()),
                                               true, 0.4, {0, -0.4, 0}, chalk)
                                   : square_floor);
    return make_scene(files, parts);
  }
  const std::vector<std::string> parameters_{"thing.translate.y", "thing.rotate.z",
                                             "floor.translate.y", "thing.translate.x"};
};

TEST_P(StandsOnAFloor, AsIfPressed) {
  GradientOptions options;
  options.parameters = parameters_;
  if (GetParam().analytic) options.method = "analytic";
  const GradientResult at = run_blocks(scene(0), options, 96, 1);
  const GradientResult pressed = run_blocks(scene(1e-4), options, 96, 2);
  // In closed form blocks that see the top alone are zero but for rounding.
  for (size_t p = 0; p < parameters_.size(); ++p)
    expect_equal(at.parameters[p], pressed.parameters[p], 1, !GetParam().analytic);
  EXPECT_NE(at.warnings.at(0).find("\"thing\" and \"floor\" touch"), std::string::npos);
}

TEST_P(StandsOnAFloor, InReverse) {
  BackwardOptions options;
  options.parameters = {"thing.translate.y"};
  if (GetParam().analytic) options.method = "analytic";
  RunSettings settings;
  settings.spp = 64;
  settings.threads = 1;
  for (const ReverseCheck& c : check_reverse(scene(0), options, settings)) {
    fmt::print("{}: {:g} +- {:.2g}, {:g} +- {:.2g}\n", c.parameter, c.forward, c.forward_error,
               c.reverse, c.reverse_error);
    EXPECT_GT(normal_p_value(c.z), kLevel / 20);
  }
}

INSTANTIATE_TEST_SUITE_P(, StandsOnAFloor, testing::ValuesIn(standing_cases()),
                         [](const auto& c) { return c.param.name; });

// Sheets whose common edges part, or pass through each other, are told of, as long as they do.
TEST(PartingSheets, AreToldOf) {
  const TempFiles files;
  const auto run = [&](const std::string& parameter) {
    SceneParts parts;
    parts.origin = {0.6, 1.8, 3.4};
    const auto tile = [](const std::string& id, double x) {
      return square(id, 0.5, -90, {x, 0, 0}, diffuse(id + "_clay", "0.5, 0.4, 0.3"));
    };
    parts.body = tile("left", -0.5) + tile("right", 0.5) +
                 square("wall", 0.5, 0, {-0.5, 0.5, -0.5}, diffuse("paint", "0.3, 0.5, 0.6")) +
                 square("shelf", 0.25, -90, {0.5, 0.3, 0}, diffuse("wood", "0.6, 0.4, 0.2")) +
                 constant_light("sky", "0.4, 0.5, 0.7");
    return run_blocks(make_scene(files, parts), {parameter}, 1, 0);
  };
  for (const char* parameter : {"right.translate.x", "right.translate.y", "right.rotate.y",
                                "wall.translate.y", "left.rotate.y", "left.scale"}) {
    const GradientResult r = run(parameter);
    EXPECT_TRUE(r.at_kink) << parameter;
    ASSERT_FALSE(r.warnings.empty()) << parameter;
    EXPECT_NE(r.warnings[0].find("touch along an edge"), std::string::npos) << r.warnings[0];
  }
  for (const char* parameter : {"shelf.translate.x", "sensor.translate.x", "right.translate.z"}) {
    const GradientResult r = run(parameter);
    EXPECT_FALSE(r.at_kink) << parameter;
    EXPECT_TRUE(r.warnings.empty()) << parameter << ": " << r.warnings[0];
  }
}

}  // namespace
}  // namespace limn
