// Images and derivatives of scenes in which shapes and cameras move while the shutter is open.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "integrators/estimates/batches.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"
#include "limn/core/parameter.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/fit.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/layers.h"
#include "limn/integrators/render.h"
#include "support/check_runs.h"
#include "support/compare_moments.h"
#include "support/meshes.h"
#include "support/motion_scenes.h"
#include "support/test_names.h"

namespace limn {
namespace {

constexpr double kLevel = 1e-4;

Moments image_of(const Scene& scene, int spp, uint64_t seed, const std::string& generator) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  RenderOptions options;
  options.generator = generator;
  return render(scene, settings, options).radiance;
}

void expect_plausible(const std::string& name, const ZSummary& summary) {
  fmt::print("{:24} {:3} values, mean z {:5.2f}, largest |z| {:5.2f}\n", name, summary.count,
             summary.mean, summary.largest);
  EXPECT_GT(summary.count, 0) << name;
  EXPECT_TRUE(summary.plausible(kLevel)) << name;
}

// A weighted sum of runs, and the scores of another one against it.
class MeanOfRuns {
 public:
  void add(const Moments& run, double weight) {
    mean_.resize(run.size());
    variance_.resize(run.size());
    for (size_t i = 0; i < run.size(); ++i) {
      mean_[i] += weight * run.mean(i);
      variance_[i] += weight * weight * run.variance(i);
    }
  }
  ZSummary scores(const Moments& run) const {
    std::vector<double> z;
    for (size_t i = 0; i < run.size(); ++i) {
      const double error = std::sqrt(run.variance(i) + variance_[i]);
      if (error > 0) z.push_back((run.mean(i) - mean_[i]) / error);
    }
    return summarize(z);
  }

 private:
  std::vector<double> mean_, variance_;
};

// A lamp whose left end crosses the view: at kEnd at the time 1/2, seen along -z from a distance of
// 4. Its end is on the film at c + k a with a uniform in [-1, 1], and a pixel from x to x + 1 sees
// it on the right: on average E(x + 1) - E(x), with E(x) = mean of max(0, x - c - k a).
constexpr double kDistance = 4, kEnd = 0.2, kRadiance = 3, kShift = 0.7;
struct Rates {
  double value, by_c, by_k;
};
Rates below(double x, double c, double k) {
  const double t = (x - c) / k;
  if (t <= -1) return {0, 0, 0};
  if (t >= 1) return {x - c, -1, 0};
  const double f = (t + 1) / 2, g = (t + 1) * (t + 1) / 4;
  return {k * g, -f, g - t * f};
}
Rates pixel(double x, double c, double k) {
  const Rates a = below(x, c, k), b = below(x + 1, c, k);
  return {b.value - a.value, b.by_c - a.by_c, b.by_k - a.by_k};
}

TEST(MotionBlur, OfALampIsItsClosedForm) {
  SceneParts parts;
  parts.origin = {0, 0, kDistance};
  parts.target = {0, 0, 0};
  parts.width = 12;
  parts.height = 2;
  parts.fov = 2 * std::atan(0.25) * 180 / kPi;
  const std::string lamp = square("lamp", 8, 0, {8 + kEnd - kShift / 2, 0, 0},
                                  area_light("glow", fmt::format("{0}, {0}, {0}", kRadiance)));
  parts.body = animated(lamp, {kShift, 0, 0});
  const Scene scene = scene_of_text(with_shutter(parts, 0, 1));
  // With tan half of the field of view 1/4 a point x to the right is at 6 + 6 x on the film.
  const double scale = 6, c = 6 + scale * kEnd, k = scale * kShift / 2;
  GradientOptions options;
  options.parameters = {"lamp.translate.x", "lamp.velocity.x", "sensor.velocity.x",
                        "sensor.shutter_open", "sensor.shutter_close"};
  // Of c and k. Opening later moves the middle by half as much and shortens the way.
  const double rates[][2] = {{scale, 0},
                             {0, scale / 2},
                             {0, -scale / 2},
                             {scale * kShift / 2, -scale * kShift / 2},
                             {scale * kShift / 2, scale * kShift / 2}};
  RunSettings settings;
  settings.spp = 2048;
  settings.seed = 5;
  const GradientResult result = gradient(scene, options, settings);
  std::vector<double> exact;
  std::vector<std::vector<double>> derivatives(5);
  for (int i = 0; i < 24; ++i) {
    const auto [value, by_c, by_k] = pixel(i % 12, c, k);
    for (int channel = 0; channel < 3; ++channel) {
      exact.push_back(kRadiance * value);
      for (size_t p = 0; p < 5; ++p) {
        derivatives[p].push_back(kRadiance * (by_c * rates[p][0] + by_k * rates[p][1]));
      }
    }
  }
  expect_plausible("image", compare_moments(result.radiance, exact));
  for (size_t p = 0; p < 5; ++p) {
    expect_plausible(options.parameters[p],
                     compare_moments(result.parameters[p].total, derivatives[p]));
  }
}

// A lamp and a screen slide over a floor, out of view. At each of the times of a quadrature a still
// scene has its image, and its derivatives by their places, in closed form.
TEST(MotionBlur, OverAFloorIsAQuadratureOfClosedForms) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.target = {0, 0, 0.5};
  parts.fov = 25;
  parts.width = parts.height = 2;  // smaller pixels have too few shadows for normal errors
  const Vec3d shift{1.6, 0.3, -0.8}, other{-1.2, 0.2, 0.4};
  const auto scene_at = [&](double t, bool moves) {
    const std::string lamp =
        square("lamp", 0.4, 90, Vec3d{-0.6, 2.8, 0.4} + shift * t, area_light("glow", "6, 5, 4"));
    std::string screen =
        square("screen", 0.5, 90, Vec3d{0.5, 1.5, 0.3} + other * t, diffuse("black", "0"));
    // Where edges of lamp and screen are parallel, derivatives jump with time.
    screen.insert(screen.find("<scale"), R"(<rotate y="1" angle="31"/><rotate x="1" angle="17"/>)");
    parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8")) +
                 (moves ? animated(lamp, shift) + animated(screen, other) : lamp + screen);
    return scene_of_text(moves ? with_shutter(parts, 0, 1) : scene_text(parts));
  };
  GradientOptions options;
  options.parameters = {"lamp.translate.x", "screen.translate.z", "lamp.velocity.x",
                        "screen.velocity.z"};
  RunSettings settings;
  settings.spp = 1024;
  const GradientResult result = gradient(scene_at(0, true), options, settings);
  GradientOptions closed;
  closed.parameters = {"lamp.translate.x", "screen.translate.z"};
  closed.method = "analytic";
  constexpr int kTimes = 48;
  RunSettings few;
  few.spp = 64;
  MeanOfRuns image, slopes[4];
  for (int i = 0; i < kTimes; ++i) {
    const double t = (i + 0.5) / kTimes;
    few.seed = 100 + i;
    const GradientResult still = gradient(scene_at(t, false), closed, few);
    image.add(still.radiance, 1.0 / kTimes);
    for (size_t k = 0; k < 4; ++k) {
      slopes[k].add(still.parameters[k % 2].total, (k < 2 ? 1 : t - 0.5) / kTimes);
    }
  }
  expect_plausible("image", image.scores(result.radiance));
  for (size_t k = 0; k < 4; ++k) {
    expect_plausible(options.parameters[k], slopes[k].scores(result.parameters[k].total));
  }
}

// A floor, a cube that turns and slides, a ball with a velocity, a sliding lamp, a point light and
// a camera that pans.
SceneParts mixed(const TempFiles& files, bool moves) {
  const auto maybe = [&](const std::string& text, const Vec3d& shift, double angle, double scale) {
    return moves ? animated(text, shift, angle, scale) : text;
  };
  SceneParts parts;
  parts.origin = {0.5, 2, 5};
  parts.target = {0, 0.6, 0};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
               maybe(obj_shape("cube", write_mesh(files, "cube.obj", cube_mesh()), true, 0.5,
                               {-0.9, 0.6, 0.6}, diffuse("clay", "0.7, 0.5, 0.3")),
                     {0.5, 0.2, 0.2}, 40, 1.2) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(1)), false, 0.5,
                         {0.8, 0.6, -0.8}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               maybe(square("lamp", 0.4, 90, {0.1, 2.8, 0.5}, area_light("glow", "6, 5, 4")),
                     {0.5, 0, 0.3}, 0, 1) +
               R"(<emitter type="point" id="spark"><point name="position" x="-1" y="3" z="1"/>
               <rgb name="intensity" value="6, 6, 6"/></emitter>)";
  return parts;
}
Scene moving(const TempFiles& files, double open = 0, double close = 1) {
  Scene scene =
      scene_of_text(animated(with_shutter(mixed(files, true), open, close), {0.2, 0, 0}, 3));
  if (scene.exposure) {
    find_parameter(scene, "ball.velocity.y").move(scene, 0.6);
    find_parameter(scene, "ball.spin.x").move(scene, 1.5);
  }
  return scene;
}

TEST(MotionBlur, IsTheMeanOfStillImages) {
  const TempFiles files;
  const Scene scene = moving(files);
  constexpr int kTimes = 64;
  MeanOfRuns mean;
  for (int i = 0; i < kTimes; ++i) {
    Scene still = at_time(scene, (i + 0.5) / kTimes);
    still.exposure = nullptr;
    mean.add(image_of(still, 32, 100 + i, "independent"), 1.0 / kTimes);
  }
  expect_plausible("image", mean.scores(image_of(scene, 1024, 1, "independent")));
}

TEST(MotionBlur, OfAClosedShutterIsTheStillImage) {
  const TempFiles files;
  const Moments closed = image_of(moving(files, 0, 0), 16, 1, "sobol");
  const Moments blurred = image_of(moving(files), 16, 1, "sobol");
  const Moments still = image_of(scene_of_text(scene_text(mixed(files, false))), 16, 1, "sobol");
  double difference = 0;
  for (size_t p = 0; p < still.size(); ++p) {
    EXPECT_EQ(closed.mean(p), still.mean(p)) << p;
    difference += std::fabs(blurred.mean(p) - still.mean(p));
  }
  EXPECT_GT(difference, 1);
}

class MotionAgrees : public testing::TestWithParam<std::string> {};
TEST_P(MotionAgrees, WithDifferences) {
  const TempFiles files;
  expect_agreement(moving(files), GetParam(), 128);
}
INSTANTIATE_TEST_SUITE_P(, MotionAgrees,
                         testing::Values("cube.velocity.x", "cube.spin.y", "cube.translate.x",
                                         "cube.rotate.z", "ball.velocity.y", "ball.spin.z",
                                         "ball.scale", "lamp.velocity.x", "floor.velocity.y",
                                         "sensor.velocity.x", "sensor.spin.y", "sensor.translate.z",
                                         "sensor.shutter_open", "sensor.shutter_close",
                                         "spark.translate.x", "clay.reflectance"),
                         name_of_string);

TEST(MotionBlur, AgreesInReverseMode) {
  const TempFiles files;
  const Scene scene = moving(files);
  BackwardOptions options;
  options.parameters = {"cube.velocity.x",  "cube.spin.y",           "cube.rotate.z",
                        "cube.translate.x", "cube.vertex_positions", "ball.displacement",
                        "ball.velocity.y",  "lamp.velocity.x",       "sensor.velocity.x",
                        "sensor.spin.y",    "sensor.translate.x",    "spark.translate.x",
                        "clay.reflectance"};
  for (const ReverseCheck& check : expect_modes_agree(scene, 64, options)) {
    EXPECT_NE(check.forward, 0) << check.parameter;
  }
}

// A motion of all vertices, as one parameter and as the sum over the derivatives of each. Those are
// by positions at the reference time, while a parameter's velocities are turned to each time.
TEST(MotionBlur, HasVerticesOfTheReferenceTimeInReverseMode) {
  const TempFiles files;
  const Scene scene = moving(files);
  std::vector<Vec3d> velocities;
  std::string lines;
  for (size_t v = 0; v < scene.shape(ShapeId(1)).mesh.weld.size(); ++v) {
    const double i = static_cast<double>(v);
    velocities.push_back({std::sin(1 + 3 * i), std::cos(2 * i), std::sin(5 * i)});
    const Vec3d& d = velocities.back();
    lines += fmt::format("{} {} {}\n", d.x, d.y, d.z);
  }
  BackwardOptions options;
  const std::string one = "cube.vertex_positions:" + files.write("velocities.txt", lines);
  options.parameters = {one, "cube.vertex_positions"};
  RunSettings settings;
  settings.spp = 16;
  Image adjoint(16, 16, 3);
  std::fill(adjoint.data.begin(), adjoint.data.end(), 1.0f);
  const BackwardResult result = backward(scene, adjoint, options, settings);
  const Moments& each = result.of("cube.vertex_positions").moments;
  ASSERT_EQ(each.size(), 3 * velocities.size());
  double sum = 0;
  for (size_t v = 0; v < velocities.size(); ++v) {
    for (int k = 0; k < 3; ++k) sum += each.mean(3 * v + k) * velocities[v][k];
  }
  const double expected = result.of(one).moments.mean(0);
  EXPECT_NE(expected, 0);
  EXPECT_NEAR(sum, expected, 1e-9 * std::fabs(expected));
}

TEST(MotionBlur, VelocityIsFitted) {
  const TempFiles files;
  Scene scene = moving(files);
  const Parameter velocity = find_parameter(scene, "ball.velocity.y");
  const Moments seen = image_of(scene, 256, 9, "sobol");
  Image target(16, 16, 3);
  for (size_t i = 0; i < seen.size(); ++i) target.data[i] = static_cast<float>(seen.mean(i));
  const double truth = velocity.value(scene)[0];
  velocity.move(scene, 1.2);
  FitOptions options;
  options.parameters = {"ball.velocity.y"};
  options.step = 4;
  options.step_half_life = 12;
  RunSettings settings;
  settings.spp = 32;
  settings.seed = 2;
  Fit fit({{scene, target, {}}}, options, settings);
  for (int i = 0; i < 60; ++i) fit.step();
  const double found = fit.scalars()[0].value;
  fmt::print("velocity {:.4f}, true {:.4f}\n", found, truth);
  EXPECT_NEAR(found, truth, 0.1);
}

// Every sample adds its time.
class Clock final : public SampleEstimator {
 public:
  Clock(const Scene& scene, double time, Numbers numbers)
      : scene_(scene), time_(time), numbers_(numbers) {}
  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "time"; }
  Numbers numbers() const override { return numbers_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override {
    for (const KeyedSample& one : samples) sink.add_radiance(one.at, {time_, time_, time_}, 1);
  }

 private:
  const Scene& scene_;
  double time_;
  Numbers numbers_;
};

// The mean times of batches of 17 and 32 samples, each in many runs: with a time for each sample,
// and with 16 in all, where the scene has many faces.
class TimesAreUniform : public testing::TestWithParam<bool> {};
TEST_P(TimesAreUniform, InLargeBatches) {
  SceneParts parts;
  parts.width = parts.height = 1;
  const TempFiles files;
  if (GetParam()) parts.body = ball_over_gloss(files, 0.4);
  const Scene scene = scene_of_text(scene_text(parts));
  for (const auto& [numbers, spp, count] :
       {std::tuple{Numbers::kIndependent, 560, 17}, {Numbers::kEvenInRun, 1056, 32}}) {
    double sum = 0, squares = 0;
    int batches = 0, times = 0;
    for (int seed = 0; seed < 50; ++seed) {
      const auto at = [&](double u) {
        ++times;
        EstimatorsAtTime now;
        now.list.push_back(std::make_unique<Clock>(scene, u, numbers));
        return now;
      };
      RunSettings settings;
      settings.spp = spp;
      settings.seed = seed;
      const auto take = [&](const Batch& batch, const auto& sums) {
        if (batch.count() != count) return;
        const double off = sums[0].radiance[0] / count - 0.5;
        sum += off;
        squares += off * off;
        ++batches;
      };
      times = -1;
      run_batches(at(0).list, settings, Stopwatch(), take, at);
      EXPECT_EQ(times < spp, GetParam()) << times;
      EXPECT_LE(times, spp);
    }
    ASSERT_GE(batches, 50);
    const double rms = std::sqrt(squares / batches);
    EXPECT_LT(rms, 0.01) << count;  // of 16 equal strata 16^-1.5 / sqrt(12) = 0.0045
    EXPECT_LT(std::fabs(sum / batches), 4 * rms / std::sqrt(batches)) << count;
  }
}
INSTANTIATE_TEST_SUITE_P(MotionBlur, TimesAreUniform, testing::Bool(),
                         [](const auto& kind) { return kind.param ? "some_times" : "all_times"; });

// A board's shadow varies more between times than at one: more samples of it at one time hardly
// help. A pilot that looked at one time alone took 32 samples of it for each of a pixel.
TEST(MotionBlur, IsWorthMoreTimesThanSamplesAtOne) {
  SceneParts parts;
  parts.origin = {0, 3, 6};
  parts.fov = 36;
  parts.width = parts.height = 48;
  const std::string board =
      square("board", 0.4, -60, {-0.3, 1.5, 0}, diffuse("clay", ".6, .5, .4"));
  parts.body = square("floor", 5, -90, {0, 0, 0}, diffuse("chalk", ".7, .7, .7")) +
               animated(board, {0.6, 0, 0}) +
               R"(<emitter type="point"><point name="position" x="0" y="4" z="1"/>)"
               R"(<rgb name="intensity" value="30"/></emitter>)";
  GradientOptions options;
  options.parameters = {"board.translate.x"};
  RunSettings settings;
  settings.spp = 16;
  const GradientResult result =
      gradient(scene_of_text(with_shutter(parts, 0, 1)), options, settings);
  const auto shadow = std::ranges::find(result.terms, std::string("shadow"), &TermRun::name);
  ASSERT_NE(shadow, result.terms.end());
  EXPECT_LT(shadow->samples, 2);
}

// Nothing moves yet while the shutter is open.
Scene at_rest(const TempFiles& files) {
  return scene_of_text(with_shutter(mixed(files, false), 0, 1));
}

TEST(MotionBlur, VelocitiesAtRestAgree) {
  const TempFiles files;
  Scene scene = at_rest(files);
  BackwardOptions options;
  options.parameters = {"ball.velocity.y", "cube.spin.y", "sensor.velocity.x"};
  expect_modes_agree(scene, 64, options);
  // Between two and three half-exposures after the reference time, 1/2: by 1 in the mean.
  own_exposure(scene).shutters[0] = {1, 2};
  for (const ReverseCheck& check : expect_modes_agree(scene, 64, options)) {
    EXPECT_NE(check.forward, 0) << check.parameter;
  }
  RunSettings settings;
  settings.spp = 256;
  const auto derivatives = [&](const std::string& of, const std::string& camera, uint64_t seed) {
    settings.seed = seed;
    GradientOptions forward;
    forward.parameters = {of, camera};
    return gradient(scene, forward, settings).parameters;
  };
  const auto moved = derivatives("ball.translate.y", "sensor.translate.x", 1);
  const auto faster = derivatives("ball.velocity.y", "sensor.velocity.x", 2);
  for (size_t k = 0; k < 2; ++k) {
    MeanOfRuns mean;
    mean.add(moved[k].total, 1);
    expect_plausible(k == 0 ? "ball" : "sensor", mean.scores(faster[k].total));
  }
}

TEST(MotionBlur, VelocitiesAtRestAreAskedForByName) {
  const TempFiles files;
  const auto listed = [](const Scene& scene, const std::string& part) {
    RunSettings settings;
    settings.spp = 1;
    std::vector<std::string> names;
    for (const auto& one : backward(scene, Image(16, 16, 3), {}, settings).parameters) {
      if (one.name.find(part) != std::string::npos) names.push_back(one.name);
    }
    return names;
  };
  EXPECT_EQ(listed(at_rest(files), "velocity").size(), 0u);
  EXPECT_EQ(listed(at_rest(files), "spin").size(), 0u);
  EXPECT_EQ(listed(at_rest(files), "ball.translate").size(), 3u);
  const Scene scene = moving(files);
  EXPECT_EQ(listed(scene, "floor.velocity").size(), 0u);
  EXPECT_EQ(listed(scene, "cube.velocity").size(), 3u);
  EXPECT_EQ(listed(scene, "ball.spin").size(), 3u);
  EXPECT_EQ(listed(scene, "sensor.spin").size(), 3u);
}

// What shapes turn about, and where keyframes are, goes with them.
TEST(MotionBlur, FitsGoOnWhereTheyWere) {
  const TempFiles files;
  FitOptions options;
  options.parameters = {"cube.translate.x", "ball.translate.z", "sensor.translate.x"};
  RunSettings settings;
  settings.spp = 2;
  const auto start = [&] {
    return Fit({{moving(files), Image(16, 16, 3), {}}}, options, settings);
  };
  Fit whole = start(), second = start();
  ASSERT_TRUE(whole.step());
  second.restore(whole.state());
  const auto late = [](const Fit& fit) { return at_time(fit.views()[0].scene, 1); };
  const Scene a = late(whole), b = late(second), before = late(start());
  for (size_t s = 0; s < a.shapes.size(); ++s) {
    EXPECT_EQ(a.shapes[s].mesh.positions, b.shapes[s].mesh.positions) << s;
  }
  EXPECT_EQ(value(a.camera.origin), value(b.camera.origin));
  EXPECT_NE(a.shapes[1].mesh.positions, before.shapes[1].mesh.positions);
}

TEST(MotionBlur, IsRefusedByName) {
  const TempFiles files;
  const Scene scene = moving(files);
  const auto message = [&](const auto& run) -> std::string {
    try {
      run();
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  };
  const auto image = [&](const RenderOptions& options) {
    return message([&] { render(scene, {}, options); });
  };
  const std::string refused = " cannot take a scene in which something moves";
  // Where nothing moves yet, but its derivative is asked for.
  GradientOptions rate;
  rate.parameters = {"ball.velocity.y"};
  rate.points = FilmPoints::kFaces;
  rate.method = "analytic";
  SceneParts still;
  still.max_depth = 2;
  still.body = square("ball", 1, 0, {0, 0, 0}, diffuse("grey", "0.5")) +
               square("lamp", 0.4, 90, {0, 3, 0}, area_light("glow", "1"));
  const Scene rest = scene_of_text(with_shutter(still, 0, 1));
  const std::string forward = message([&] { gradient(rest, rate, {}); });
  EXPECT_NE(forward.find(refused), std::string::npos) << forward;
  BackwardOptions back;
  back.parameters = rate.parameters;
  back.points = FilmPoints::kFaces;
  back.method = "analytic";
  const std::string reverse = message([&] { backward(rest, Image(16, 16, 3), back, {}); });
  EXPECT_NE(reverse.find(refused), std::string::npos) << reverse;
  EXPECT_NE(image({.method = "lines"}).find("\"lines\"" + refused), std::string::npos);
  RenderOptions faces;
  faces.points = FilmPoints::kFaces;
  faces.method = "analytic";
  EXPECT_NE(image(faces).find(refused), std::string::npos);
  EXPECT_NE(message([&] { render_layers(scene, {"depth"}, {}); }).find("layers" + refused),
            std::string::npos);
  BackwardOptions options;
  options.parameters = {"sensor.shutter_open"};
  const Image adjoint(16, 16, 3);
  EXPECT_NE(message([&] {
              backward(scene, adjoint, options, {});
            }).find("the parameter \"sensor.shutter_open\" has no reverse mode"),
            std::string::npos);
}

}  // namespace
}  // namespace limn
