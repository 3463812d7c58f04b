// Shapes that touch have the gradient of the same surface made in one piece, or of the same shapes
// with a gap that nobody sees.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include "support/block_runs.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// by_blocks: whether blocks of pixels are compared, too. Where a plane holds all that moves, those
// that see nothing else are zero but for the rounding of cosines.
void expect_equal(const Scene& a, const Scene& b, const std::string& parameter,
                  bool by_blocks = true) {
  constexpr int kSpp = 256;
  const GradientResult ga = run_blocks(a, {parameter}, kSpp, 1),
                       gb = run_blocks(b, {parameter}, kSpp, 2);
  expect_equal(ga.parameters[0], gb.parameters[0], 1, by_blocks);
}

struct Quad {
  Vec3f corner, a, b;
};

Mesh mesh_of(const std::vector<Quad>& quads) {
  std::vector<Vec3f> x;
  std::vector<FaceIndices> faces;
  for (const auto& [c, a, b] : quads) {
    const auto k = static_cast<uint32_t>(x.size());
    x.insert(x.end(), {c, c + a, c + a + b, c + b});
    faces.insert(faces.end(), {{k, k + 1, k + 2}, {k, k + 2, k + 3}});
  }
  return make_mesh(x, faces);
}

const std::vector<Quad> kCube = {
    {{-1, -1, -1}, {0, 2, 0}, {2, 0, 0}}, {{-1, -1, 1}, {2, 0, 0}, {0, 2, 0}},
    {{-1, -1, -1}, {2, 0, 0}, {0, 0, 2}}, {{-1, 1, -1}, {0, 0, 2}, {2, 0, 0}},
    {{-1, -1, -1}, {0, 0, 2}, {0, 2, 0}}, {{1, -1, -1}, {0, 2, 0}, {0, 0, 2}}};

// Shapes made of quads under a lamp and a sky; `unit` is the length of one.
class Stage {
 public:
  explicit Stage(double unit = 1) : unit_(unit) {
    parts_.unit = unit;
    parts_.origin = {0.6, 1.8, 3.4};
    parts_.target = {0, 0.4, 0};
    parts_.body =
        diffuse("white", "0.75, 0.75, 0.75") + diffuse("clay", "0.7, 0.4, 0.2") +
        square("lamp", 0.5 * unit, 90, Vec3d{0.3, 2.6, 0.5} * unit, area_light("glow", "6, 5, 4")) +
        constant_light("sky", "0.4, 0.5, 0.7");
  }
  void add(const std::string& id, const std::vector<Quad>& quads, const std::string& bsdf,
           double scale = 1, const Vec3d& offset = {}) {
    parts_.body += obj_shape(id, write_mesh(files_, id + ".obj", mesh_of(quads)), true,
                             scale * unit_, offset * unit_, "<ref id=\"" + bsdf + "\"/>");
  }
  Scene scene() const { return make_scene(files_, parts_); }

 private:
  TempFiles files_;
  SceneParts parts_;
  double unit_;
};

const Quad kFloor{{-3, 0, 3}, {6, 0, 0}, {0, 0, -6}};

class Units : public testing::TestWithParam<double> {};

TEST_P(Units, SidesOfABox) {
  Stage apart(GetParam()), whole(GetParam());
  for (Stage* stage : {&apart, &whole}) stage->add("floor", {kFloor}, "white");
  for (size_t k = 0; k < kCube.size(); ++k)
    apart.add(fmt::format("side{}", k), {kCube[k]}, "clay", 0.5, {0, 0.7, 0});
  whole.add("box", kCube, "clay", 0.5, {0, 0.7, 0});
  expect_equal(apart.scene(), whole.scene(), "sensor.translate.x");
}

TEST_P(Units, BoxOnTheFloor) {
  // In one piece: a floor with a hole, and four walls and a lid that rise from its rim.
  Stage two(GetParam()), one(GetParam());
  two.add("floor", {kFloor}, "white");
  two.add("box", kCube, "white", 0.5, {0, 0.5, 0});
  std::vector<Quad> piece{{{-3, 0, 3}, {6, 0, 0}, {0, 0, -2.5}},
                          {{-3, 0, -0.5}, {6, 0, 0}, {0, 0, -2.5}},
                          {{-3, 0, 0.5}, {2.5, 0, 0}, {0, 0, -1}},
                          {{0.5, 0, 0.5}, {2.5, 0, 0}, {0, 0, -1}}};
  for (const auto& [c, a, b] : kCube)
    if (c.y + a.y + b.y > -1) piece.push_back({c * 0.5f + Vec3f{0, 0.5, 0}, a * 0.5f, b * 0.5f});
  one.add("piece", piece, "white");
  expect_equal(two.scene(), one.scene(), "sensor.translate.x");
  expect_equal(two.scene(), one.scene(), "sensor.translate.y");
}

INSTANTIATE_TEST_SUITE_P(, Units, testing::Values(1e-3, 1.0, 1e3), [](const auto& test) {
  return test.param < 1 ? "small" : test.param > 1 ? "large" : "one";
});

TEST(TouchingShapes, FloorOfTiles) {
  Stage tiles, whole;
  whole.add("floor", {kFloor}, "white");
  tiles.add("left", {{{-3, 0, 3}, {2.7f, 0, 0}, {0, 0, -6}}}, "white");
  tiles.add("front", {{{-0.3f, 0, 3}, {3.3f, 0, 0}, {0, 0, -2.9f}}}, "white");
  tiles.add("back", {{{-0.3f, 0, 0.1f}, {3.3f, 0, 0}, {0, 0, -3.1f}}}, "white");
  for (Stage* stage : {&tiles, &whole}) stage->add("box", kCube, "clay", 0.3, {0.4, 0.9, 0});
  expect_equal(tiles.scene(), whole.scene(), "sensor.translate.x");
  expect_equal(tiles.scene(), whole.scene(), "box.translate.x");
}

// A wall on the border of a floor, and one that stands inside of it; each shape comes first once.
TEST(TouchingShapes, FloorAndWall) {
  const Quad wall{{-2, 0, -1}, {4, 0, 0}, {0, 3, 0}};
  const Quad half{{-2, 0, 3}, {4, 0, 0}, {0, 0, -4}};
  Stage border, border_whole, inside, inside_whole;
  border.add("floor", {half}, "white");
  border.add("wall", {wall}, "white");
  border_whole.add("room", {half, wall}, "white");
  inside.add("wall", {wall}, "white");
  inside.add("floor", {kFloor}, "white");
  std::vector<Quad> whole{wall};
  for (const auto& [x, width] : {std::pair{-3.0f, 1.0f}, {-2.0f, 4.0f}, {2.0f, 1.0f}})
    for (const auto& [z, depth] : {std::pair{3.0f, -4.0f}, {-1.0f, -2.0f}})
      whole.push_back({{x, 0, z}, {width, 0, 0}, {0, 0, depth}});
  inside_whole.add("room", whole, "white");
  expect_equal(border.scene(), border_whole.scene(), "sensor.translate.y");
  expect_equal(inside.scene(), inside_whole.scene(), "sensor.translate.y");
}

TEST(TouchingShapes, TJunction) {
  Stage cut, whole;
  std::vector<Quad> quads(kCube.begin(), kCube.end());
  whole.add("box", quads, "clay", 0.5, {0, 0.75, 0});
  const Quad top = quads[3];
  quads[3] = {top.corner, top.a * 0.3f, top.b};
  quads.push_back({top.corner + top.a * 0.3f, top.a * 0.7f, top.b});
  cut.add("box", quads, "clay", 0.5, {0, 0.75, 0});
  for (Stage* stage : {&cut, &whole}) stage->add("floor", {kFloor}, "white");
  expect_equal(cut.scene(), whole.scene(), "box.translate.y");
}

// Tiles that move apart: each rim against what is seen in the gap.
TEST(TouchingShapes, TilesThatPart) {
  const auto tiles = [](float gap) {
    Stage stage;
    stage.add("left", {{{-2, 0.5f, 2}, {2, 0, 0}, {0, 0, -4}}}, "white");
    stage.add("right", {{{gap, 0.5f, 2}, {2, 0, 0}, {0, 0, -4}}}, "clay");
    stage.add("floor", {{{-4, -0.5f, 4}, {8, 0, 0}, {0, 0, -8}}}, "white");
    return stage.scene();
  };
  expect_equal(tiles(0), tiles(2e-5f), "right.translate.x", false);
  expect_equal(tiles(0), tiles(2e-5f), "left.translate.x", false);
  expect_equal(tiles(0), tiles(2e-5f), "right.translate.y", false);
  expect_equal(tiles(0), tiles(2e-5f), "right.rotate.y", false);
  expect_equal(tiles(0), tiles(2e-5f), "sensor.translate.x");
}

// A box slides over the floor.
TEST(TouchingShapes, SlidingBox) {
  const auto box = [](double gap) {
    Stage stage;
    stage.add("floor", {kFloor}, "white");
    // No side in one plane with the camera: the derivative would have a kink.
    stage.add("box", kCube, "clay", 0.5, {0.15, 0.5 + gap, 0.2});
    return stage.scene();
  };
  expect_equal(box(0), box(2e-5), "box.translate.x");
}

// Boxes of one plan, each of which sinks into the one below by less than faces have to have in
// common to overlap: what is seen is one box.
TEST(TouchingShapes, BoxesThatSinkByAMillionth) {
  const auto box = [](float low, float high) {
    const Vec3f plan[] = {
        {0.75f, 0, 0.25f}, {0.25f, 0, -0.75f}, {-0.75f, 0, -0.25f}, {-0.25f, 0, 0.75f}};
    const Vec3f up{0, high - low, 0}, base{0, low, 0};
    std::vector<Quad> quads = {{plan[0] + base + up, plan[1] - plan[0], plan[3] - plan[0]},
                               {plan[0] + base, plan[3] - plan[0], plan[1] - plan[0]}};
    for (int k = 0; k < 4; ++k) quads.push_back({plan[k] + base, plan[(k + 1) % 4] - plan[k], up});
    return quads;
  };
  constexpr int kBoxes = 16;
  Stage apart, whole;
  for (Stage* stage : {&apart, &whole}) stage->add("floor", {kFloor}, "white");
  for (int k = 0; k < kBoxes; ++k) {
    const float low = 0.25f + static_cast<float>(k) / kBoxes;
    apart.add(fmt::format("box{}", k), box(low - 1e-6f, low + 1.0f / kBoxes), "clay");
  }
  whole.add("box", box(0.25f, 1.25f), "clay");
  expect_equal(apart.scene(), whole.scene(), "sensor.translate.x");
}

// Where a surface passes through another one exactly along edges of it that are none, as its faces
// lie in one plane: rows of a box, a seam of tiles.
TEST(TouchingShapes, CrossingAlongSeams) {
  Stage rows, whole, tiles, floor;
  std::vector<Quad> halves;
  for (const auto& [c, a, b] : kCube) {
    if (a.y == 0 && b.y == 0) {
      halves.push_back({c, a, b});
      continue;
    }
    const Vec3f up = a.y == 0 ? b : a, along = a.y == 0 ? a : b;
    for (const Vec3f& corner : {c, c + up * 0.5f})
      halves.push_back(a.y == 0 ? Quad{corner, along, up * 0.5f} : Quad{corner, up * 0.5f, along});
  }
  for (Stage* stage : {&rows, &whole}) stage->add("floor", {kFloor}, "white");
  rows.add("box", halves, "clay", 0.5, {0.15, 0, 0.2});
  whole.add("box", kCube, "clay", 0.5, {0.15, 0, 0.2});
  for (const char* parameter : {"sensor.translate.x", "box.translate.x", "box.rotate.y"})
    expect_equal(rows.scene(), whole.scene(), parameter);
  const Quad wall{{-2, -1, -1}, {4, 0, 0}, {0, 2, 0}};
  for (Stage* stage : {&tiles, &floor}) stage->add("wall", {wall}, "clay");
  tiles.add("front", {{{-3, 0, 3}, {6, 0, 0}, {0, 0, -4}}}, "white");
  tiles.add("back", {{{-3, 0, -1}, {6, 0, 0}, {0, 0, -2}}}, "white");
  floor.add("floor", {kFloor}, "white");
  expect_equal(tiles.scene(), floor.scene(), "sensor.translate.y");
}

// A sphere whose seam and poles are copies that differ by a rounding.
TEST(TouchingShapes, SeamOfASphere) {
  const auto sphere = [](const TempFiles& files, bool rounded) {
    constexpr int kRows = 8, kColumns = 12;
    std::vector<Vec3f> x;
    std::vector<FaceIndices> faces;
    for (int i = 0; i <= kRows; ++i)
      for (int k = 0; k <= kColumns; ++k) {
        const double a = kPi * i / kRows, b = 2 * kPi * k / kColumns;
        Vec3d p{std::sin(a) * std::cos(b), std::cos(a), std::sin(a) * std::sin(b)};
        if (!rounded) {
          const double c = 2 * kPi * (k % kColumns) / kColumns;
          const double s = i % kRows == 0 ? 0 : std::sin(a);
          p = {s * std::cos(c), std::cos(a), s * std::sin(c)};
        }
        x.push_back(cast<float>(p));
      }
    for (uint32_t i = 0; i < kRows; ++i)
      for (uint32_t k = 0; k < kColumns; ++k) {
        const uint32_t v = i * (kColumns + 1) + k, w = v + kColumns + 1;
        faces.push_back({v, v + 1, w});
        faces.push_back({v + 1, w + 1, w});
      }
    SceneParts parts;
    parts.origin = {0.6, 1.8, 3.4};
    parts.body =
        square("floor", 3, -90, {0, 0, 0}, diffuse("white", "0.75, 0.75, 0.75")) +
        obj_shape("ball", write_mesh(files, rounded ? "r.obj" : "s.obj", make_mesh(x, faces)),
                  false, 0.6, {0, 0.9, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
        square("lamp", 0.5, 90, {0.3, 2.6, 0.5}, area_light("glow", "6, 5, 4")) +
        constant_light("sky", "0.4, 0.5, 0.7");
    return make_scene(files, parts);
  };
  const TempFiles files;
  const Scene rounded = sphere(files, true), same = sphere(files, false);
  EXPECT_EQ(rounded.shapes[1].mesh.faces.size(), same.shapes[1].mesh.faces.size());
  expect_equal(rounded, same, "ball.rotate.x");
  expect_equal(rounded, same, "ball.translate.x");
}

}  // namespace
}  // namespace limn
