// Pixels made of their visible faces: closed forms, differences of their own image, degenerate
// views, the order of what they miss, and bits on any number of threads.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/parts.h"
#include "limn/integrators/render.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr const char* kBox = R"(<rfilter type="box"/>)";

RunSettings threads(int count) {
  RunSettings settings;
  settings.threads = count;
  return settings;
}

std::vector<double> image_of(const Scene& scene, int count = 1) {
  const RenderResult result =
      render(scene, threads(count), {.method = "analytic", .points = FilmPoints::kFaces});
  EXPECT_EQ(result.spp, 1);
  EXPECT_EQ(result.radiance.variance(0), 0);
  return means(result.radiance);
}

GradientResult gradient_of(const Scene& scene, const std::vector<std::string>& parameters,
                           int count = 1) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = "analytic";
  options.points = FilmPoints::kFaces;
  GradientResult result = gradient(scene, options, threads(count));
  EXPECT_EQ(result.non_finite.count, 0u);
  return result;
}
std::vector<double> derivative_of(const Scene& scene, const std::string& parameter) {
  return means(gradient_of(scene, {parameter}).parameters[0].total);
}

double size_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v * v;
  return std::sqrt(sum);
}
std::vector<double> minus(std::vector<double> a, const std::vector<double>& b) {
  for (size_t i = 0; i < a.size(); ++i) a[i] -= b[i];
  return a;
}
std::vector<double> difference_of(const Scene& scene, const Parameter& parameter, double h) {
  std::vector<double> d =
      minus(image_of(parameter.moved(scene, h)), image_of(parameter.moved(scene, -h)));
  for (double& x : d) x /= 2 * h;
  return d;
}

// A camera 8 before the plane z = 0, of which `across` units fill the film.
SceneParts facing(int pixels, double across) {
  SceneParts parts;
  parts.max_depth = 1;
  parts.origin = {0, 0, 8};
  parts.target = {0, 0, 0};
  parts.fov = 2 * std::atan(across / 16) * 180 / kPi;
  parts.width = parts.height = pixels;
  parts.film = kBox;
  return parts;
}

// How much of [a, b] is in pixel i of n that fill [-across/2, across/2].
double overlap(double a, double b, int i, int n, double across) {
  const double x0 = across * (static_cast<double>(i) / n - 0.5), x1 = x0 + across / n;
  return std::max(0.0, std::min(b, x1) - std::max(a, x0)) * n / across;
}

// A lamp of known radiance, half out of some pixels: its area in each times the radiance. Moved,
// its two upright sides sweep over what they have of their height in a pixel; raised, the others.
TEST(Faces, ASquareHasItsArea) {
  const TempFiles files;
  SceneParts parts = facing(4, 4);
  // From -0.7 to 0.9 across, -0.5 to 1.1 upwards.
  parts.body = square("lamp", 0.8, 0, {0.1, 0.3, 0}, area_light("glow", "3, 2, 1"));
  const Scene scene = make_scene(files, parts);
  const std::vector<double> image = image_of(scene);
  const GradientResult d = gradient_of(scene, {"lamp.translate.x", "lamp.translate.y", "lamp.scale",
                                               "glow.radiance", "sensor.translate.x"});
  const auto height_at = [&](int y) { return overlap(-1.1, 0.5, y, 4, 4); };
  const auto width_at = [&](int x) { return overlap(-0.7, 0.9, x, 4, 4); };
  const auto is_in = [](double x, int i) { return x > i - 2 && x < i - 1 ? 1.0 : 0.0; };
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      const size_t green = 3 * (4 * y + x) + 1;
      const double w = width_at(x), h = height_at(y);
      const double left = is_in(-0.7, x), right = is_in(0.9, x);
      const double top = is_in(-1.1, y), bottom = is_in(0.5, y);
      const double expected[] = {2 * h * (right - left), 2 * w * (top - bottom),
                                 2 * 0.8 * (h * (left + right) + w * (top + bottom)), w * h,
                                 2 * h * (left - right)};
      // Positions are floats.
      EXPECT_NEAR(image[green], 2 * w * h, 1e-6);
      for (int k = 0; k < 5; ++k) {
        EXPECT_NEAR(d.parameters[k].total.mean(green), expected[k], 1e-6)
            << d.parameters[k].name << " " << x << " " << y;
        EXPECT_EQ(d.parameters[k].total.variance(green), 0);
      }
    }
  }
}

// Two lamps that go through each other along the line x = 0, seen from straight above it, and one
// of them moved: both turned by 45 degrees about y, so that the line goes half as far.
TEST(Faces, WhereFacesCrossTheLineMoves) {
  const TempFiles files;
  SceneParts parts = facing(1, 1);
  const auto leaf = [](const char* id, double angle, const char* light) {
    return fmt::format(R"(<shape type="rectangle" id="{}"><transform name="to_world">
        <scale x="2" y="2"/><rotate y="1" angle="{}"/></transform>{}</shape>)",
                       id, angle, area_light(std::string("of_") + id, light));
  };
  parts.body = leaf("a", 45, "1, 1, 1") + leaf("b", -45, "4, 4, 4");
  const Scene scene = make_scene(files, parts);
  const std::vector<double> image = image_of(scene);
  EXPECT_NEAR(image[0], 2.5, 1e-6);
  // Along x both planes are z = x and z = -x, in some order: moved by t, they meet at t/2.
  const double d = derivative_of(scene, "a.translate.x")[0];
  EXPECT_NEAR(std::fabs(d), 1.5, 1e-5);
  const Parameter p = find_parameter(scene, "a.translate.x");
  EXPECT_NEAR(difference_of(scene, p, 0x1p-8)[0], d, 1e-4);
}

// Faces of one square, in halves on one side of a seam that the other side has not: nothing shows
// through, and their parts add up to the whole.
TEST(Faces, TJunctionsAreTight) {
  const TempFiles files;
  SceneParts parts = facing(5, 2);
  const Mesh mesh = make_mesh({{-2, -2, 0}, {2, -2, 0}, {-2, 2, 0}, {2, 2, 0}, {0, 0, 0}},
                              {{0, 1, 2}, {1, 3, 4}, {3, 2, 4}});
  parts.body = obj_shape("sheet", write_mesh(files, "sheet.obj", mesh), true, 1,
                         {0x1p-6, 0x1p-7, 0}, area_light("glow", "1, 1, 1")) +
               square("behind", 4, 0, {0, 0, -1}, area_light("other", "100, 100, 100"));
  const Scene scene = make_scene(files, parts);
  for (const double v : image_of(scene)) EXPECT_NEAR(v, 1, 1e-12);
  for (const char* name : {"sheet.translate.x", "sheet.rotate.z", "sheet.scale"}) {
    for (const double v : derivative_of(scene, name)) EXPECT_NEAR(v, 0, 1e-6) << name;
  }
}

// A lamp right behind another of the same outline, as the camera sees it: one step aside it shows,
// whichever way. The line between them is told to be the front's, which stands still: the slope in
// the middle of both.
TEST(Faces, WhatIsAboutToShowIsStill) {
  const TempFiles files;
  SceneParts parts = facing(1, 4);
  parts.body = square("front", 0.5, 0, {0, 0, 4}, area_light("dim", "1, 1, 1")) +
               square("back", 1, 0, {0, 0, 0}, area_light("bright", "9, 9, 9"));
  const Scene scene = make_scene(files, parts);
  const double here = image_of(scene)[0], d = derivative_of(scene, "back.translate.x")[0];
  EXPECT_NEAR(here, 0.25, 1e-6);
  const Parameter p = find_parameter(scene, "back.translate.x");
  const double after = (image_of(p.moved(scene, 0x1p-8))[0] - here) * 0x1p8;
  const double before = (here - image_of(p.moved(scene, -0x1p-8))[0]) * 0x1p8;
  EXPECT_NEAR(after, 9 * 2 / 16.0, 1e-3);
  EXPECT_NEAR(before, -9 * 2 / 16.0, 1e-3);
  EXPECT_EQ(d, 0);
}

double sum_of(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += v;
  return sum;
}

// Of a sum over pixels, at steps that floats hold exactly. There is no kink in it: each way it
// changes alike.
void expect_one_slope(const Scene& scene, const std::string& name, double told, double error) {
  const Parameter p = find_parameter(scene, name);
  const double h = 0x1p-14, here = sum_of(image_of(scene));
  const double after = (sum_of(image_of(p.moved(scene, h))) - here) / h,
               before = (here - sum_of(image_of(p.moved(scene, -h)))) / h;
  EXPECT_NEAR(after, told, error) << name;
  EXPECT_NEAR(before, told, error) << name;
}

// The corners of the lamp are those of pixels, so that its sides lie on borders, and the seam
// between its faces leads through corners. What a side sweeps falls into one pixel or the other:
// half of it is told in each, and their sum is the sum's derivative.
TEST(Faces, HalfOfABordersMotionIsInEachPixel) {
  const TempFiles files;
  SceneParts parts = facing(4, 4);
  parts.body = square("lamp", 1, 0, {0, 0, 0}, area_light("glow", "3, 2, 1"));
  const Scene scene = make_scene(files, parts);
  const std::vector<std::string> names = {"lamp.translate.x", "lamp.translate.y", "lamp.scale",
                                          "sensor.translate.x", "sensor.fov"};
  const GradientResult d = gradient_of(scene, names);
  const double sides[] = {-0.5, -0.5, 0.5, 0.5}, fills[] = {0, 1, 1, 0};
  // Of the half width of what the camera sees, 8 tan(fov / 2), by degrees.
  const double wider = 8 * (1 + 1 / 16.0) * 0.5 * kPi / 180;
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) {
      const size_t green = 3 * (4 * y + x) + 1;
      const double h = fills[y], w = fills[x];
      const double grows = 2 * (h * std::fabs(sides[x]) + w * std::fabs(sides[y]));
      const double expected[] = {2 * h * sides[x], -2 * w * sides[y], grows, -2 * h * sides[x],
                                 -grows * wider / 2};
      for (size_t k = 0; k < names.size(); ++k) {
        EXPECT_NEAR(d.parameters[k].total.mean(green), expected[k], 1e-6)
            << names[k] << " " << x << " " << y;
      }
    }
  }
  // Of the second order a step of 2^-14 leaves some 1e-3.
  for (size_t k = 0; k < names.size(); ++k) {
    expect_one_slope(scene, names[k], sum_of(means(d.parameters[k].total)), 3e-3);
  }
  for (const char* name : {"lamp.vertex_positions.0.x", "lamp.vertex_positions.3.y"}) {
    const std::vector<double> told = derivative_of(scene, name);
    EXPECT_GT(size_of(told), 1);
    expect_one_slope(scene, name, sum_of(told), 1e-3);
    const Parameter p = find_parameter(scene, name);
    EXPECT_LT(size_of(minus(difference_of(scene, p, 0x1p-14), told)), 1e-3) << name;
  }
}

// The same whichever side of the border rounding may take it to, and wherever on the film.
TEST(Faces, BordersAreFoundDespiteRounding) {
  const TempFiles files;
  for (const double off : {0.0, 1e-11, -1e-11, 2e-11, -2e-11}) {
    SceneParts parts = facing(64, 4);
    parts.body = square("lamp", 1, 0, {0, 0, 0}, area_light("glow", "1, 1, 1"));
    Scene scene = make_scene(files, parts);
    for (int k = 0; k < 3; ++k) scene.camera.origin[k].v += off * (k == 0);
    const std::vector<double> d = derivative_of(scene, "lamp.translate.x");
    for (int x : {15, 16, 47, 48}) {
      EXPECT_NEAR(d[3 * (64 * 20 + x)], (x < 32 ? -0.5 : 0.5) * 16, 1e-4) << off << " " << x;
    }
    EXPECT_NEAR(sum_of(d), 0, 1e-6);
  }
}

// Behind others nothing that moves is seen, and nothing comes of it, not even rounding.
TEST(Faces, WhatIsHiddenAddsNothing) {
  const TempFiles files;
  SceneParts parts = facing(4, 4);
  parts.body = square("front", 3, 0, {0, 0, 1}, area_light("dim", "1, 1, 1")) +
               square("back", 1, 30, {0.1, 0, -3}, area_light("bright", "9, 9, 9"));
  const Scene scene = make_scene(files, parts);
  for (const double v : derivative_of(scene, "back.translate.x")) EXPECT_EQ(v, 0);
}

Mesh on_a_grid(Mesh mesh, uint64_t seed) {
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    for (int k = 0; k < 3; ++k) {
      const double moved = mesh.positions[v][k] + 0.1 * (Rng(seed, v, k).uniform() - 0.5);
      mesh.positions[v][k] = static_cast<float>(std::round(moved * 0x1p9) * 0x1p-9);
    }
  }
  return mesh;
}

// Bodies of both kinds of normals, one through another, one cut by a clip plane, before two lamps.
// Coordinates are dyadic, so that small moves are exact in floats.
Scene crowd(const TempFiles& files, int size = 12, double near = 0, bool smooth = true) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0.25, 2.5, 4};
  parts.target = {0, 0.5, 0};
  parts.width = parts.height = size;
  parts.film = kBox;
  const std::string ring = write_mesh(files, "ring.obj", on_a_grid(torus_mesh(7, 4), 1));
  const std::string ball = write_mesh(files, "ball.obj", on_a_grid(icosphere_mesh(1), 2));
  const std::string block = write_mesh(files, "block.obj", on_a_grid(cube_mesh(), 3));
  parts.body =
      square("floor", 4, -90, {0, 0, 0}, diffuse("grey", ".5, .6, .7")) +
      obj_shape("ring", ring, true, 0.5, {0, 0.75, 0}, diffuse("clay", ".6, .5, .4")) +
      obj_shape("ball", ball, !smooth, 0.5, {-0.75, 0.625, 0.5}, diffuse("blue", ".1, .2, .8")) +
      obj_shape("block", block, true, 0.25, {0.5, 0.5, 0.25}, diffuse("red", ".8, .2, .1")) +
      square("lamp", 0.75, 90, {0.5, 3.5, 1}, area_light("glow", "6, 5, 4")) +
      square("seen", 0.5, 0, {-0.5, 1.5, -2}, area_light("shine", "2, 3, 4"));
  Scene scene = make_scene(files, parts);
  if (near > 0) scene.camera.near_clip = near;
  return scene;
}

// Of every kind of parameter, at steps that floats hold exactly.
void expect_own_differences(const Scene& scene, const std::vector<std::string>& names,
                            double error = 1e-6) {
  const GradientResult d = gradient_of(scene, names);
  for (size_t k = 0; k < names.size(); ++k) {
    const Parameter p = find_parameter(scene, names[k]);
    const std::vector<double> told = means(d.parameters[k].total);
    double least = INFINITY;
    for (const int power : {12, 14, 16}) {
      const double h = std::ldexp(1.0, -power);
      least = std::min(least, size_of(minus(difference_of(scene, p, h), told)));
    }
    fmt::print("{:24} {:10.4g}, differences off by {:.1e} of it\n", names[k], size_of(told),
               least / size_of(told));
    EXPECT_LE(least, error * size_of(told)) << names[k];
    EXPECT_GT(size_of(told), 0.01) << names[k];
  }
}

// Of every kind.
const std::vector<std::string> kOfEveryKind = {"ring.translate.x",
                                               "ball.translate.y",
                                               "block.translate.z",
                                               "floor.translate.y",
                                               "lamp.translate.x",
                                               "seen.translate.x",
                                               "ring.vertex_positions.5.x",
                                               "ball.vertex_positions.8.y",
                                               "sensor.translate.x",
                                               "sensor.translate.z",
                                               "sensor.rotate.y",
                                               "sensor.fov",
                                               "clay.reflectance",
                                               "grey.reflectance.g",
                                               "glow.radiance",
                                               "shine.radiance"};

TEST(Faces, DerivativesAreThoseOfTheImage) {
  const TempFiles files;
  expect_own_differences(crowd(files, 12, 0, false), kOfEveryKind);
}

// A plate with its sides on borders of pixels before a wall, or a wall of faces whose seams lie
// there. What differences of kinks miss goes with the step.
TEST(Faces, DerivativesOfAlignedBodiesAreThoseOfTheImage) {
  const TempFiles files;
  const std::string wall = write_mesh(files, "wall.obj", grid_mesh(16));
  const auto scene_of = [&](const std::string& bodies) {
    SceneParts parts = facing(16, 4);
    parts.max_depth = 2;
    parts.body =
        bodies + square("lamp", 0.7, 180, {0.53, 0.41, 10}, area_light("glow", "60, 50, 40"));
    return make_scene(files, parts);
  };
  const std::string grey = diffuse("grey", ".5, .6, .7"), red = diffuse("red", ".8, .2, .1");
  expect_own_differences(
      scene_of(square("wall", 2.5, 10, {0.1, 0, 0}, area_light("dim", ".5, .6, .7")) +
               square("plate", 0.5, 0, {0, 0, 4}, area_light("bright", "3, 2, 5"))),
      {"plate.translate.x", "plate.translate.y", "plate.scale", "sensor.translate.x", "sensor.fov",
       "dim.radiance"},
      1e-4);
  expect_own_differences(scene_of(obj_shape("wall", wall, true, 2, {0, 0, 0}, grey) +
                                  square("plate", 0.5, 0, {0.06, 0.04, 4}, red)),
                         {"plate.translate.x", "plate.translate.y", "plate.scale",
                          "wall.translate.z", "sensor.translate.x", "sensor.rotate.z"},
                         1e-4);
}

// At the rim of smooth bodies light is a quadrature, good to 1e-4 of what these few points send.
TEST(Faces, DerivativesOfSmoothBodiesAreThoseOfTheImage) {
  const TempFiles files;
  expect_own_differences(crowd(files), {"ball.translate.y", "lamp.translate.x", "sensor.rotate.x"},
                         1e-5);
}

TEST(Faces, DerivativesAtAClipPlaneAreThoseOfTheImage) {
  const TempFiles files;
  const Scene scene = crowd(files, 12, 4.25, false);
  expect_own_differences(scene, {"ring.translate.z", "ball.translate.x", "sensor.translate.z",
                                 "sensor.rotate.x", "sensor.fov"});
}

// The numbers of an array that a single coordinate, or a channel, is one of.
double reverse_of(const BackwardResult& result, const std::string& name) {
  for (const char* array : {".vertex_positions.", ".reflectance."}) {
    const size_t at = name.find(array);
    if (at == std::string::npos) continue;
    const std::string whole = name.substr(0, at + std::string(array).size() - 1);
    const std::string rest = name.substr(at + std::string(array).size());
    const size_t channel = std::string("xyzrgb").find(rest.back()) % 3;
    const size_t row = rest.size() > 1 ? std::stoul(rest) : 0;
    return result.of(whole).moments.mean(3 * row + channel);
  }
  const Moments& m = result.of(name).moments;
  double sum = 0;
  for (size_t i = 0; i < m.size(); ++i) sum += m.mean(i);
  return sum;
}

// Reverse mode finds all at once what forward mode finds one by one; at a clip plane, too.
class ForwardAndReverse : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Faces, ForwardAndReverse, testing::Values(0, 4.25));

TEST_P(ForwardAndReverse, AreOne) {
  const TempFiles files;
  const Scene scene = crowd(files, 12, GetParam());
  Image adjoint(12, 12, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i) {
    adjoint.data[i] = static_cast<float>(Rng(5, i, 0).uniform() - 0.5);
  }
  BackwardOptions options;
  options.method = "analytic";
  options.points = FilmPoints::kFaces;
  const BackwardResult one = backward(scene, adjoint, options, threads(1));
  const BackwardResult three = backward(scene, adjoint, options, threads(3));
  EXPECT_EQ(one.spp, 1);
  for (size_t p = 0; p < one.parameters.size(); ++p) {
    EXPECT_EQ(means(one.parameters[p].moments), means(three.parameters[p].moments));
    EXPECT_EQ(one.parameters[p].moments.variance(0), 0);
  }
  std::vector<std::string> names = kOfEveryKind;
  names.insert(names.end(), {"ring.rotate.y", "ball.scale", "sensor.rotate.z", "seen.rotate.x"});
  for (const std::string& name : names) {
    const std::vector<double> d = derivative_of(scene, name);
    double sum = 0, size = 0;
    for (size_t i = 0; i < d.size(); ++i) {
      sum += d[i] * adjoint.data[i];
      size += std::fabs(d[i] * adjoint.data[i]);
    }
    EXPECT_NEAR(reverse_of(one, name), sum, 1e-12 * size) << name;
    EXPECT_NE(sum, 0) << name;
  }
}

TEST(Faces, BitsDoNotDependOnThreads) {
  const TempFiles files;
  const Scene scene = crowd(files, 20);
  EXPECT_EQ(image_of(scene, 1), image_of(scene, 3));
  const std::vector<std::string> names = {"ring.translate.x", "sensor.fov", "glow.radiance",
                                          "ball.rotate.x", "seen.translate.y"};
  const GradientResult one = gradient_of(scene, names, 1), three = gradient_of(scene, names, 3);
  for (size_t k = 0; k < names.size(); ++k) {
    EXPECT_EQ(means(one.parameters[k].total), means(three.parameters[k].total));
  }
  // A parameter's derivative does not depend on what goes with it, and the image is the same.
  EXPECT_EQ(means(one.parameters[4].total), derivative_of(scene, names[4]));
  const std::vector<double> image = image_of(scene), beside = means(one.radiance);
  EXPECT_LE(size_of(minus(image, beside)), 1e-13 * size_of(image));
}

// Means of blocks of `by` times `by` pixels.
std::vector<double> reduced(const std::vector<double>& image, int width, int by) {
  const int small = width / by;
  std::vector<double> result(static_cast<size_t>(3) * small * small);
  for (int y = 0; y < width; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        result[3 * (y / by * small + x / by) + c] += image[3 * (y * width + x) + c] / (by * by);
      }
    }
  }
  return result;
}

double mean_magnitude(const std::vector<double>& values) {
  double sum = 0;
  for (const double v : values) sum += std::fabs(v);
  return sum / static_cast<double>(values.size());
}

// Pixels of half the size miss a quarter, once they are small beside what they show.
TEST(Faces, TheErrorGoesWithTheSquareOfAPixel) {
  const TempFiles files;
  const std::string block = write_mesh(files, "block.obj", on_a_grid(cube_mesh(), 3));
  const auto image_at = [&](int pixels) {
    SceneParts parts;
    parts.max_depth = 2;
    parts.origin = {0.25, 2.5, 4};
    parts.target = {0, 0.25, 0};
    parts.width = parts.height = pixels;
    parts.film = kBox;
    parts.body =
        square("floor", 4, -90, {0, 0, 0}, diffuse("grey", ".5, .6, .7")) +
        obj_shape("block", block, true, 0.75, {0.25, 2, 0.25}, diffuse("red", ".8, .2, .1")) +
        square("lamp", 2, 90, {0.5, 4, 1}, area_light("glow", "6, 5, 4"));
    return image_of(make_scene(files, parts), 2);
  };
  constexpr int kFine = 256;
  const std::vector<double> truth = image_at(kFine);
  double error[2];
  for (int k = 0; k < 2; ++k) {
    const int by = 4 << k;
    error[k] = mean_magnitude(minus(image_at(kFine / by), reduced(truth, kFine, by)));
  }
  // The fine image misses a sixteenth of what the first one does.
  const double ratio = error[1] / error[0] * (1 - 1.0 / 16) / (1 - 1.0 / 64);
  fmt::print("mean error at 64 and 32 pixels {:.3g}, {:.3g}: {:.3g} times\n", error[0], error[1],
             ratio);
  EXPECT_NEAR(ratio, 4, 1);
}

// Samples have the mean that ever smaller pixels go to; pixels of their own size have not.
TEST(Faces, SmallPixelsAgreeWithSamples) {
  const TempFiles files;
  constexpr int kFine = 96, kCoarse = 16;
  RunSettings settings = threads(2);
  settings.spp = 200;
  settings.seed = 3;
  const Moments random = render(crowd(files, kCoarse), settings, {.method = "analytic"}).radiance;
  const auto mean_square_score = [&](const std::vector<double>& image) {
    double sum = 0, count = 0;
    for (size_t i = 0; i < image.size(); ++i) {
      const double variance = random.variance(i);
      if (variance < 1e-12) continue;
      sum += (image[i] - random.mean(i)) * (image[i] - random.mean(i)) / variance;
      ++count;
    }
    EXPECT_GT(count, 500);
    return sum / count;
  };
  const double fine =
      mean_square_score(reduced(image_of(crowd(files, kFine), 2), kFine, kFine / kCoarse));
  const double coarse = mean_square_score(image_of(crowd(files, kCoarse)));
  fmt::print("mean square of z: {:.3g}, of pixels of their size {:.3g}\n", fine, coarse);
  // Of channels that hang together, some 200 of them: 4 standard deviations.
  EXPECT_LT(fine, 1.4);
  EXPECT_GT(coarse, 2);
}

TEST(Faces, ChecksAgainstItsOwnImage) {
  const TempFiles files;
  const Scene scene = crowd(files);
  CheckOptions options;
  options.method = "analytic";
  options.parameter = "sensor.translate.x";
  const FacesCheck good = check_faces(scene, options, threads(1));
  EXPECT_EQ(good.verdict, Verdict::kAgree);
  EXPECT_LT(good.error, 1e-5);
}

// What is a hundredth off is told, and so is what differences cannot be trusted to have found.
TEST(Faces, ChecksTellWhatIsOff) {
  const TempFiles files;
  const Scene scene = crowd(files, 12, 0, false);
  const auto checked = [&](double factor, double step) {
    CheckOptions options;
    options.method = "analytic";
    options.parameter = "ring.translate.x";
    options.step = step;
    return check_faces(scene, options, threads(1),
                       [&](const Scene& s, const GradientOptions& o, const RunSettings& r) {
                         GradientResult result = gradient(s, o, r);
                         std::vector<double> image = means(result.parameters[0].total);
                         for (double& v : image) v *= factor;
                         result.parameters[0].total = Moments(image.size());
                         result.parameters[0].total.add_exact(image);
                         return result;
                       });
  };
  EXPECT_EQ(checked(1, 0x1p-6).verdict, Verdict::kAgree);
  EXPECT_EQ(checked(1.01, 0x1p-6).verdict, Verdict::kDisagree);
  // Positions are floats: such steps are rounded by a part of them.
  const FacesCheck small = checked(1, 3e-6);
  EXPECT_GT(small.known, 1e-3);
  EXPECT_LT(small.known, 0.2);
  EXPECT_EQ(small.verdict, Verdict::kCannotTell);
  // Nothing moves at all: differences of two steps are alike.
  EXPECT_EQ(checked(1, 1e-12).verdict, Verdict::kCannotTell);
}

// Light is linear in a reflectance, and about black two steps agree to the last bit: what the
// gradient is rounded to is no error.
TEST(Faces, ChecksAllowForRounding) {
  const TempFiles files;
  Scene scene = crowd(files, 12, 0, false);
  CheckOptions options;
  options.method = "analytic";
  int checked = 0;
  for (const Parameter& parameter : list_parameters(scene)) {
    if (!parameter.name.ends_with("reflectance")) continue;
    parameter.assign(scene, {0});
    options.parameter = parameter.name;
    const FacesCheck r = check_faces(scene, options, threads(1));
    EXPECT_EQ(r.verdict, Verdict::kAgree) << parameter.name;
    EXPECT_LT(r.error, 1e-9) << parameter.name;
    ++checked;
  }
  EXPECT_GT(checked, 1);
}

// A pixel that is not finite adds nothing, whichever of many parameters or faces it is by.
TEST(Faces, NothingIsAddedOfPixelsThatAreNotFinite) {
  const TempFiles files;
  SceneParts parts = facing(2, 2);
  const auto lamp = [](const char* id, double x, const char* light) {
    return square(id, 0.2, 0, {x, 0.5, 0}, area_light(std::string("of_") + id, light));
  };
  parts.body = lamp("a", -0.75, "1, 1, 1") + lamp("b", -0.3, "1, 1, 1") + lamp("c", 0.5, "1, 1, 1");
  Scene scene = make_scene(files, parts);
  find_parameter(scene, "of_b.radiance").move(scene, 1e300);  // more than files hold
  std::string field;
  for (size_t v = 0; v < scene.shapes[1].mesh.positions.size(); ++v) field += "1e38 0 0\n";
  GradientOptions options;
  options.parameters = {"of_a.radiance", "of_b.radiance", "of_c.radiance", "sensor.translate.x",
                        "b.vertex_positions:" + files.write("far.txt", field)};
  options.method = "analytic";
  options.points = FilmPoints::kFaces;
  const GradientResult d = gradient(scene, options, threads(1));
  EXPECT_EQ(d.non_finite.count, 1u);
  EXPECT_EQ(d.radiance.mean(0), 0);
  for (const ParameterGradient& g : d.parameters) EXPECT_EQ(g.total.mean(0), 0) << g.name;
  EXPECT_NEAR(d.parameters[2].total.mean(3), 0.16, 1e-6);

  Image adjoint(2, 2, 3);
  for (float& v : adjoint.data) v = 1;
  for (int c = 0; c < 3; ++c) adjoint.data[c] = 1e38F;
  BackwardOptions reverse;
  reverse.method = "analytic";
  reverse.points = FilmPoints::kFaces;
  const BackwardResult r = backward(scene, adjoint, reverse, threads(1));
  EXPECT_EQ(r.non_finite.count, 1u);
  EXPECT_EQ(r.of("of_a.radiance").moments.mean(0), 0);
  EXPECT_NEAR(r.of("of_c.radiance").moments.mean(0), 0.16, 1e-6);
}

TEST(Faces, RefusesWhatHasNone) {
  const TempFiles files;
  SceneParts parts = facing(2, 2);
  parts.body = square("lamp", 1, 0, {0, 0, 0}, area_light("glow", "1, 1, 1"));
  const auto refuses = [](const auto& run, const std::string& what) {
    try {
      run();
      ADD_FAILURE() << what << " was taken";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(what), std::string::npos) << error.what();
    }
  };
  const Scene scene = make_scene(files, parts);
  refuses([&] { render(scene, {}, {.points = FilmPoints::kFaces}); }, "\"path\" samples it");
  refuses(
      [&] {
        render(scene, {},
               {.method = "analytic",
                .points = FilmPoints::kFaces,
                .what = RenderWhat::kAmbientOcclusion});
      },
      "knows radiance alone");
  GradientOptions options;
  options.parameters = {"glow.radiance"};
  options.points = FilmPoints::kFaces;
  refuses([&] { gradient(scene, options, {}); }, "samples it");
  options.method = "analytic";
  PartWriter writer({1, 2}, "", "");
  RunSettings part;
  part.store = &writer;
  const char* kNoParts = "it has no parts";
  refuses([&] { render(scene, part, {.method = "analytic", .points = FilmPoints::kFaces}); },
          kNoParts);
  refuses([&] { gradient(scene, options, part); }, kNoParts);
  BackwardOptions reverse;
  reverse.method = "analytic";
  reverse.points = FilmPoints::kFaces;
  refuses([&] { backward(scene, Image(2, 2, 3), reverse, part); }, kNoParts);
  options.terms = {"camera"};
  refuses([&] { gradient(scene, options, {}); }, "terms of this scene: faces");
  parts.film = R"(<rfilter type="gaussian"/>)";
  const Scene wide = make_scene(files, parts);
  refuses([&] { image_of(wide); }, "needs a box filter");
}

}  // namespace
}  // namespace limn
