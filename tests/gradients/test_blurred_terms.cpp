// Terms of derivatives through a lens while shapes move, against means over still pinholes at
// random lens points and times, whose derivatives have other terms: of faces that a pixel shows, of
// light in closed form, or differences.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "limn/core/exposure.h"
#include "limn/core/rng.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"
#include "support/term_factor.h"

namespace limn {
namespace {

constexpr int kRuns = 32;

// A parameter, one of still scenes, and the share of that from the middle of the shutter on.
struct Compared {
  std::string moving, still;
  bool by_time = false;
};

struct Case {
  SceneParts parts;
  double focus;
  std::vector<Compared> parameters;
  GradientOptions stills;  // but for their parameters
  int still_spp;
  int points = 32;  // of lens and shutter, for each run
};

Scene through_lens_and_shutter(const Case& of) {
  std::string text = with_shutter(of.parts, 0, 1);
  const std::string pinhole = "<sensor type=\"perspective\">";
  text.replace(text.find(pinhole), pinhole.size(),
               fmt::format(R"(<sensor type="thinlens"><float name="aperture_radius" value="0.1"/>
                           <float name="focus_distance" value="{}"/>)",
                           of.focus));
  return scene_of_text(text);
}

// What a point of the lens sees at a time.
Scene still_at(const Scene& scene, const LensPoint& point, double u) {
  Scene still = at_time(scene, u);
  still.exposure = nullptr;
  Camera& camera = still.camera;
  const double x = camera.aperture_radius.v * point.x, y = camera.aperture_radius.v * point.y;
  const double film = 2 * std::tan(camera.fov.v * (kPi / 360)) * camera.x_factor;
  camera.origin = camera.origin + camera.left * Dual(x) + camera.up * Dual(y);
  camera.offset_x += x / camera.focus_distance.v / film;
  camera.offset_y += y / camera.focus_distance.v / film * camera.width / camera.height;
  camera.aperture_radius = 0;
  return still;
}

// Points of a Latin hypercube: the mean over them is, on average, that over lens and shutter.
std::vector<std::array<double, 3>> random_points(int run, int count) {
  std::vector<std::array<double, 3>> points(count);
  Rng rng(77, run, 0);
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < count; ++i) {
      points[i][k] = (i + rng.uniform()) / count;
      std::swap(points[i][k], points[static_cast<size_t>(rng.uniform() * (i + 1))][k]);
    }
  }
  return points;
}

Values reference(const Scene& scene, const Case& of, int run) {
  GradientOptions options = of.stills;
  for (const Compared& one : of.parameters) options.parameters.push_back(one.still);
  RunSettings settings;
  settings.spp = of.still_spp;
  std::vector<Values> all;
  for (const auto& [u, v, time] : random_points(run, of.points)) {
    settings.seed = 1000 * (run + 1) + all.size();
    const Scene still = still_at(scene, lens_point(u, v), time);
    const GradientResult result = gradient(still, options, settings);
    Values& values = all.emplace_back();
    for (size_t p = 0; p < of.parameters.size(); ++p) {
      Values own = means(result.parameters[p].total);
      if (of.parameters[p].by_time) {
        for (double& x : own) x *= time - 0.5;
      }
      append(values, own);
    }
  }
  return mean_values(all);
}

// terms: those that are judged. A fault of the size `scale` is found.
void expect_factors(const Case& of, const std::string& method, int spp,
                    const std::vector<std::string>& terms, double scale = 0.1) {
  const Scene scene = through_lens_and_shutter(of);
  GradientOptions options;
  options.method = method;
  for (const Compared& one : of.parameters) options.parameters.push_back(one.moving);
  std::vector<Values> errors;
  std::map<std::string, std::vector<Values>> found;
  for (int j = 0; j < kRuns; ++j) {
    const Values exact = reference(scene, of, j);
    RunSettings settings;
    settings.spp = spp;
    settings.seed = 100 + j;
    const GradientResult result = gradient(scene, options, settings);
    Values total;
    std::map<std::string, Values> own;
    for (const ParameterGradient& g : result.parameters) {
      append(total, means(g.total));
      for (size_t t = 0; t < g.terms.size(); ++t) {
        append(own[result.terms[t].name], means(g.terms[t]));
      }
    }
    errors.push_back(difference(total, exact));
    for (const auto& [name, values] : own) found[name].push_back(values);
  }
  const std::vector<size_t> groups(of.parameters.size(), errors[0].size() / of.parameters.size());
  size_t judged = 0;
  for (const auto& [name, values] : found) {
    if (std::ranges::find(terms, name) == terms.end()) continue;
    expect_factor(fmt::format("{} of {}", name, method), term_factor(errors, values, groups),
                  scale);
    ++judged;
  }
  EXPECT_EQ(judged, terms.size());
}

std::string cube(const TempFiles& files, double size, const Vec3d& at, const std::string& bsdf) {
  return obj_shape("body", write_mesh(files, "body.obj", cube_mesh()), true, size, at, bsdf);
}

// Lamps, and a black body before them: what a pixel shows has one radiance, or none.
TEST(BlurredTerms, CameraHasItsFactor) {
  const TempFiles files;
  Case of;
  of.parts.max_depth = 1;
  of.parts.origin = {0.2, 0.3, 4};
  of.parts.target = {0, 0, 0};
  of.parts.fov = 24;
  of.parts.width = of.parts.height = 4;
  of.parts.body =
      animated(square("lamp", 0.5, 0, {-0.2, 0.1, 0}, area_light("glow", "3, 2, 1")), {0.3, 0.1, 0},
               20) +
      animated(cube(files, 0.2, {0.2, 0, 1}, diffuse("black", "0")), {-0.2, 0.2, 0.3}, 25);
  of.focus = 3;
  of.parameters = {{"lamp.translate.x", "lamp.translate.x"},
                   {"body.translate.y", "body.translate.y"},
                   {"body.velocity.x", "body.translate.x", true},
                   {"sensor.translate.x", "sensor.translate.x"}};
  of.stills.method = "analytic";
  of.stills.points = FilmPoints::kFaces;
  of.still_spp = 1;
  of.points = 8;
  expect_factors(of, "forest", 64, {"camera"});
}

// The penumbra of a body beside the view, from a lamp of this half-width.
Case penumbra(const TempFiles& files, double size) {
  Case of;
  of.parts.max_depth = 2;
  of.parts.origin = {0, 6, 0.5};
  of.parts.target = {0, 0, 0};
  of.parts.fov = 14;
  of.parts.width = of.parts.height = 8;
  of.parts.body =
      square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
      animated(cube(files, 0.3, {1.4, 1, 0.1}, diffuse("clay", "0.1")), {0.2, 0.1, -0.1}, 10) +
      animated(square("lamp", size, 90, {5.2, 4, 0.3}, area_light("glow", "30, 30, 30")),
               {-0.3, 0, 0.3});
  of.focus = 5;
  of.parameters = {{"body.translate.x", "body.translate.x"},
                   {"lamp.translate.y", "lamp.translate.y"},
                   {"body.velocity.y", "body.translate.y", true},
                   {"chalk.reflectance", "chalk.reflectance"}};
  of.stills.method = "analytic";
  of.still_spp = 4;
  of.points = 16;
  return of;
}
TEST(BlurredTerms, BoundaryHasItsFactor) {
  const TempFiles files;
  expect_factors(penumbra(files, 0.5), "forest", 88, {"interior", "boundary"});
}
TEST(BlurredTerms, DirectHasItsFactor) {
  const TempFiles files;
  expect_factors(penumbra(files, 0.5), "silhouettes", 16, {"interior", "direct"});
}
TEST(BlurredTerms, PenumbraHasItsFactor) {
  const TempFiles files;
  expect_factors(penumbra(files, 0.05), "silhouettes", 160, {"penumbra"}, 0.2);
}

TEST(BlurredTerms, ShadowHasItsFactor) {
  const TempFiles files;
  Case of = penumbra(files, 0.5);
  of.parts.body =
      square("floor", 3, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.7, 0.6")) +
      animated(cube(files, 0.3, {1.4, 1, 0.1}, diffuse("clay", "0.1")), {0.2, 0.1, -0.1}, 10) +
      R"(<emitter type="point" id="spark"><point name="position" x="5.2" y="4" z="0.3"/>
      <rgb name="intensity" value="30, 30, 30"/></emitter>)";
  of.parameters = {{"body.translate.x", "body.translate.x"}};
  of.stills = {};
  of.stills.method = "fd";
  of.stills.step = 0.02;
  of.still_spp = 16;
  expect_factors(of, "forest", 128, {"shadow"}, 0.2);
}

}  // namespace
}  // namespace limn
