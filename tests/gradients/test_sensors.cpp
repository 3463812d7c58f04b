// Images and derivatives through a thin lens and of an orthographic sensor.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/render.h"
#include "support/check_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

// With another sensor in place of the pinhole. more: its elements.
std::string with_sensor(const SceneParts& parts, const std::string& type, const std::string& more) {
  std::string text = scene_text(parts);
  const std::string first = "<sensor type=\"perspective\">";
  text.replace(text.find(first), first.size(), "<sensor type=\"" + type + "\">" + more);
  return text;
}
std::string lens(double radius, double focus) {
  return fmt::format(
      R"(<float name="aperture_radius" value="{}"/><float name="focus_distance" value="{}"/>)",
      radius, focus);
}
Scene scene_of(const std::string& text) { return read_scene_text(text, "", {}, nullptr); }
Scene orthographic(const SceneParts& parts, double half_width) {
  std::string text = with_sensor(parts, "orthographic", "");
  const size_t fov = text.find("<float name=\"fov\"");
  text.erase(fov, text.find("/>", fov) + 2 - fov);
  const std::string to_world = "<transform name=\"to_world\">";
  text.insert(text.find(to_world) + to_world.size(),
              fmt::format("<scale x=\"{0}\" y=\"{0}\"/>", half_width));
  return scene_of(text);
}

// A lamp that ends in the view, on its left, at z = 0, seen along -z from a distance of 4.
constexpr double kDistance = 4, kEnd = 0.2, kRadiance = 3;
SceneParts lamp_in_view() {
  SceneParts parts;
  parts.origin = {0, 0, kDistance};
  parts.target = {0, 0, 0};
  parts.width = 12;
  parts.height = 2;
  parts.fov = 2 * std::atan(0.25) * 180 / kPi;
  parts.body = square("lamp", 8, 0, {8 + kEnd, 0, 0},
                      area_light("glow", fmt::format("{0}, {0}, {0}", kRadiance)));
  return parts;
}

Moments image_of(const Scene& scene, int spp, uint64_t seed) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  return render(scene, settings, {}).radiance;
}

TEST(Lens, OfRadiusZeroIsAPinhole) {
  const SceneParts parts = lamp_in_view();
  const Moments pinhole = image_of(scene_of(scene_text(parts)), 16, 1);
  const Moments none = image_of(scene_of(with_sensor(parts, "thinlens", lens(0, 3))), 16, 1);
  const Moments tiny = image_of(scene_of(with_sensor(parts, "thinlens", lens(1e-9, 3))), 16, 1);
  for (size_t i = 0; i < pinhole.size(); ++i) {
    EXPECT_EQ(pinhole.mean(i), none.mean(i));
    EXPECT_NEAR(pinhole.mean(i), tiny.mean(i), 1e-12);
  }
}

// The lamp's end at the position X = c + k a of the film, a across the lens with the density
// 2 / pi sqrt(1 - a^2). A pixel from x to x + 1 sees the lamp on its right: on average
// E(x + 1) - E(x), with E(x) = mean of max(0, x - X) = |k| G((x - c) / |k|).
class LampEnd {
 public:
  LampEnd(double c, double k) : c_(c), k_(std::fabs(k)), sign_(k < 0 ? -1 : 1) {}
  struct Rates {
    double value, by_c, by_k;
  };
  Rates pixel(double x) const {
    if (x - c_ >= k_) return {1, 0, 0};
    const Rates a = at(x), b = at(x + 1);
    return {b.value - a.value, b.by_c - a.by_c, b.by_k - a.by_k};
  }

 private:
  // G(t) = integral of F up to t, F the distribution of a.
  Rates at(double x) const {
    const double t = (x - c_) / k_;
    if (t <= -1) return {0, 0, 0};
    if (t >= 1) return {x - c_, -1, 0};
    const double f = 0.5 + (t * std::sqrt(1 - t * t) + std::asin(t)) / kPi;
    const double g = t * f + 2 / (3 * kPi) * std::pow(1 - t * t, 1.5);
    return {k_ * g, -f, sign_ * (g - t * f)};
  }
  double c_, k_, sign_;
};

// With tan half of the field of view 1/4 and W pixels, a point at depth z and x to the right is at
// W / 2 (1 + 4 x / z), and moves by W / 2 * 4 r (1 / z - 1 / f) over the lens, up to a sign.
TEST(Lens, ShowsALampInClosedForm) {
  const double radius = 0.5, focus = 2.5, scale = 12 / 2.0 * 4;
  const Scene scene = scene_of(with_sensor(lamp_in_view(), "thinlens", lens(radius, focus)));
  const double z = kDistance, defocus = 1 / focus - 1 / z;
  const LampEnd end(6 + scale * kEnd / z, scale * radius * defocus);
  GradientOptions options;
  options.parameters = {"sensor.aperture_radius", "sensor.focus_distance", "sensor.translate.z",
                        "sensor.translate.x", "lamp.translate.x"};
  // Of c and k.
  const double rates[][2] = {{0, scale * defocus},
                             {0, -scale * radius / (focus * focus)},
                             {-scale * kEnd / (z * z), scale * radius / (z * z)},
                             {-scale / z, 0},
                             {scale / z, 0}};
  RunSettings settings;
  settings.spp = 4096;
  settings.seed = 5;
  const GradientResult result = gradient(scene, options, settings);
  std::vector<double> exact;
  std::vector<std::vector<double>> derivatives(5);
  for (int i = 0; i < 24; ++i) {
    const auto [value, by_c, by_k] = end.pixel(i % 12);
    for (int c = 0; c < 3; ++c) {
      exact.push_back(kRadiance * value);
      for (size_t p = 0; p < 5; ++p) {
        derivatives[p].push_back(kRadiance * (by_c * rates[p][0] + by_k * rates[p][1]));
      }
    }
  }
  const auto expect = [&](const std::string& name, const ZSummary& summary) {
    fmt::print("{:24} {:3} values, mean z {:5.2f}, largest |z| {:5.2f}\n", name, summary.count,
               summary.mean, summary.largest);
    EXPECT_GT(summary.count, 0) << name;
    EXPECT_TRUE(summary.plausible(kLevel)) << name;
  };
  expect("image", compare_moments(result.radiance, exact));
  for (size_t p = 0; p < 5; ++p) {
    expect(options.parameters[p], compare_moments(result.parameters[p].total, derivatives[p]));
  }
}

// On a film of the half width 1 the lamp's end is at W / 2 (1 + x), whatever its distance.
TEST(Orthographic, ShowsALampInClosedForm) {
  const Scene scene = orthographic(lamp_in_view(), 1);
  GradientOptions options;
  options.parameters = {"lamp.translate.x", "sensor.translate.x", "sensor.translate.z",
                        "sensor.rotate.y"};
  const double rates[] = {-1, 1, 0, -kDistance};  // of the lit part of the film, over W / 2
  RunSettings settings;
  settings.spp = 64;
  const GradientResult result = gradient(scene, options, settings);
  for (size_t p = 0; p < options.parameters.size(); ++p) {
    double sum = 0;
    for (size_t i = 0; i < 72; ++i) sum += result.parameters[p].total.mean(i);
    EXPECT_NEAR(sum, rates[p] * 6 * 2 * 3 * kRadiance, 1e-6) << options.parameters[p];
  }
}

// A cube, a ball, a leaf, a lamp and a point light over a floor.
SceneParts mixed(const TempFiles& files) {
  SceneParts parts;
  parts.origin = {0.5, 2, 5};
  parts.target = {0, 0.6, 0};
  const std::string leaf =
      R"(<bsdf type="twosided">)" + diffuse("green", "0.3, 0.6, 0.2") + "</bsdf>";
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
               obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5,
                         {-0.7, 0.6, 1.2}, diffuse("clay", "0.7, 0.5, 0.3")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5,
                         {0.7, 0.6, -0.8}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("leaf", write_mesh(files, "leaf.obj", grid_mesh(2)), true, 0.6,
                         {0.2, 1.2, 0.3}, leaf) +
               square("lamp", 0.4, 90, {0.3, 2.8, 0.5}, area_light("glow", "6, 5, 4")) +
               R"(<emitter type="point" id="spark"><point name="position" x="-1" y="3" z="1"/>
               <rgb name="intensity" value="6, 6, 6"/></emitter>)";
  return parts;
}
Scene through_a_lens(const TempFiles& files) {
  return scene_of(with_sensor(mixed(files), "thinlens", lens(0.3, 4)));
}
Scene along_a_direction(const TempFiles& files) { return orthographic(mixed(files), 1.9); }

class LensAgrees : public testing::TestWithParam<std::string> {};
TEST_P(LensAgrees, WithDifferences) {
  const TempFiles files;
  expect_agreement(through_a_lens(files), GetParam(), 128);
}
INSTANTIATE_TEST_SUITE_P(, LensAgrees,
                         testing::Values("sensor.translate.x", "sensor.translate.z",
                                         "sensor.rotate.y", "sensor.fov", "sensor.aperture_radius",
                                         "sensor.focus_distance", "cube.translate.x",
                                         "ball.rotate.z", "leaf.translate.y", "lamp.translate.x",
                                         "spark.translate.x"),
                         name_of_string);

class ParallelAgrees : public testing::TestWithParam<std::string> {};
TEST_P(ParallelAgrees, WithDifferences) {
  const TempFiles files;
  expect_agreement(along_a_direction(files), GetParam(), 128);
}
INSTANTIATE_TEST_SUITE_P(, ParallelAgrees,
                         testing::Values("sensor.translate.x", "sensor.rotate.y", "sensor.rotate.z",
                                         "cube.translate.x", "ball.scale", "leaf.rotate.z",
                                         "lamp.translate.x", "spark.translate.x"),
                         name_of_string);

void expect_reverse(const Scene& scene, const std::vector<std::string>& parameters) {
  BackwardOptions options;
  options.parameters = parameters;
  for (const ReverseCheck& check : expect_modes_agree(scene, 64, options)) {
    EXPECT_NE(check.forward, 0) << check.parameter;
  }
}

TEST(Sensors, AgreeInReverseMode) {
  const TempFiles files;
  expect_reverse(through_a_lens(files),
                 {"sensor.translate.x", "sensor.rotate.x", "sensor.fov", "sensor.aperture_radius",
                  "sensor.focus_distance", "cube.translate.x", "ball.vertex_positions",
                  "lamp.translate.x", "spark.translate.x"});
  expect_reverse(along_a_direction(files),
                 {"sensor.translate.x", "sensor.rotate.x", "cube.translate.x",
                  "ball.vertex_positions", "lamp.translate.x", "spark.translate.x"});
}

// All sides of a box are seen edge-on, each with two of its edges in one line.
TEST(Orthographic, SidesSeenEdgeOn) {
  const TempFiles files;
  SceneParts parts;
  parts.origin = {0, 0, 4};
  parts.target = {0, 0, 0};
  parts.max_depth = 2;
  parts.body = obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5, {0, 0, 0},
                         diffuse("clay", "0.7, 0.5, 0.3")) +
               constant_light("sky", "1, 2, 3");
  const Scene scene = orthographic(parts, 1.3);
  for (const char* parameter : {"cube.translate.x", "cube.scale", "sensor.translate.y"}) {
    expect_agreement(scene, parameter, 128);
  }
}

// The lens is found that took a picture.
TEST(Lens, FocusIsFitted) {
  const TempFiles files;
  Scene scene = through_a_lens(files);
  const Parameter focus = find_parameter(scene, "sensor.focus_distance");
  const Moments seen = image_of(scene, 4096, 9);
  Image target(16, 16, 3);
  for (size_t i = 0; i < seen.size(); ++i) target.data[i] = static_cast<float>(seen.mean(i));
  focus.move(scene, 2);
  FitOptions options;
  options.parameters = {"sensor.focus_distance"};
  options.step = 4;
  options.step_half_life = 10;
  RunSettings settings;
  settings.spp = 64;
  settings.seed = 2;
  Fit fit({{scene, target, {}}}, options, settings);
  for (int i = 0; i < 40; ++i) fit.step();
  const double found = fit.scalars()[0].value;
  fmt::print("focus {:.4f}\n", found);
  EXPECT_NEAR(found, 4, 0.2);  // a tenth of the way
}

TEST(Sensors, RefuseWhatNeedsAPinhole) {
  const TempFiles files;
  for (const Scene& scene : {through_a_lens(files), along_a_direction(files)}) {
    const auto message = [&](const RenderOptions& options) -> std::string {
      try {
        render(scene, {}, options);
      } catch (const InputError& error) {
        return error.what();
      }
      return "";
    };
    RenderOptions faces;
    faces.points = FilmPoints::kFaces;
    faces.method = "analytic";
    EXPECT_NE(message(faces).find("needs a pinhole"), std::string::npos);
    EXPECT_NE(message({.method = "lines"}).find("\"lines\" needs a pinhole"), std::string::npos);
    GradientOptions gradients;
    gradients.parameters = {"cube.translate.x"};
    gradients.points = FilmPoints::kFaces;
    gradients.method = "analytic";
    EXPECT_THROW(gradient(scene, gradients, {}), InputError);
  }
}

}  // namespace
}  // namespace limn
