// The method fastest: what it chooses, what it says of that, and that the run is the chosen one's.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <map>

#include "limn/integrators/methods.h"
#include "support/meshes.h"
#include "support/same_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

std::map<std::string, std::variant<double, std::string>> settings_of(const GradientResult& run) {
  std::map<std::string, std::variant<double, std::string>> settings;
  for (const MethodSetting& setting : run.settings) settings[setting.name] = setting.value;
  return settings;
}
constexpr const char* kRatio = "expected squared error of fd over adaptive's";
std::string chosen(const GradientResult& run) {
  return std::get<std::string>(settings_of(run).at("chosen"));
}

// A lamp moves over a glossy floor: the light itself varies, and images of it are cheap.
Scene moving_lamp(const TempFiles& files) {
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.1)) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.8,
                         {0.2, 1, 0}, conductor("metal", 0.3)) +
               square("lamp", 0.3, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4"));
  return make_scene(files, parts);
}
constexpr const char* kLamp = "lamp.translate.x";

// A square moves before a lamp over a diffuse floor: differences see its edge in few samples.
Scene soft_shadow(const TempFiles& files) {
  SceneParts parts;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("plaster", "0.7, 0.6, 0.5")) +
               square("blocker", 0.4, -90, {0, 1, 0}, diffuse("clay", "0.5, 0.5, 0.5")) +
               square("lamp", 0.8, 90, {0.2, 2.5, 0}, area_light("light", "8, 8, 8"));
  return make_scene(files, parts);
}
constexpr const char* kBlocker = "blocker.translate.x";

TEST(Fastest, TakesWhatNeedsLessTime) {
  const TempFiles files;
  const Scene lamp = moving_lamp(files), shadow = soft_shadow(files);
  for (const uint64_t seed : {1, 3, 4}) {
    const GradientResult a = run_method(lamp, {kLamp}, "fastest", 32, seed);
    EXPECT_EQ(chosen(a), "fd (biased)");
    EXPECT_LT(std::get<double>(settings_of(a).at(kRatio)), 1);
    const GradientResult b = run_method(shadow, {kBlocker}, "fastest", 32, seed);
    EXPECT_EQ(chosen(b), "adaptive");
    EXPECT_GT(std::get<double>(settings_of(b).at(kRatio)), 1);
  }
}

TEST(Fastest, IsTheChosenMethod) {
  const TempFiles files;
  const Scene shadow = soft_shadow(files);
  const GradientResult adaptive = run_method(shadow, {kBlocker}, "fastest", 32, 1, 1);
  expect_same_bits(adaptive, run_method(shadow, {kBlocker}, "adaptive", 32, 1, 3));
  EXPECT_TRUE(adaptive.warnings.empty());

  const Scene lamp = moving_lamp(files);
  const GradientResult one = run_method(lamp, {kLamp}, "fastest", 32, 1, 1);
  const GradientResult three = run_method(lamp, {kLamp}, "fastest", 32, 1, 3);
  EXPECT_GE(one.spp, 32);
  EXPECT_EQ(one.spp, three.spp);
  expect_same_bits(one, three);
  GradientOptions options;
  options.parameters = {kLamp};
  options.method = "fd";
  options.step = std::get<double>(settings_of(one).at("step"));
  expect_same_bits(one, run_blocks(lamp, options, static_cast<int>(one.spp), 1, 2));
}

TEST(Fastest, SaysThatDifferencesAreBiased) {
  EXPECT_TRUE(Method("fastest")->biased);
  const TempFiles files;
  const std::vector<std::string> parameters = {kLamp, "lamp.translate.z"};
  const GradientResult run = run_method(moving_lamp(files), parameters, "fastest", 32, 1);
  ASSERT_EQ(chosen(run), "fd (biased)");
  for (const std::string& parameter : parameters) {
    const std::string name = "bias of " + parameter + " (root mean square), at most";
    const double bias = std::get<double>(settings_of(run).at(name));
    EXPECT_GT(bias, 0);
    EXPECT_TRUE(std::isfinite(bias));
  }
  EXPECT_EQ(run.planned_spp, run.spp);
  EXPECT_GT(run.spp, 32);
  ASSERT_GE(run.warnings.size(), 2u);
  EXPECT_NE(run.warnings[0].find("is biased"), std::string::npos) << run.warnings[0];
}

// It has the samples that were asked for, but not the last of those that the pilots planned.
TEST(Fastest, TellsThatItIsNotComplete) {
  const TempFiles files;
  GradientOptions options;
  options.parameters = {kLamp};
  options.method = "fastest";
  options.samples = std::nullopt;
  std::atomic<bool> interrupted = false;
  RunSettings settings;
  settings.spp = 32;
  settings.seed = 1;
  settings.threads = 1;
  settings.interrupted = &interrupted;
  settings.progress = [&](double done) { interrupted = done > 0.9; };
  const GradientResult run = gradient(moving_lamp(files), options, settings);
  ASSERT_EQ(chosen(run), "fd (biased)");
  EXPECT_GE(run.spp, 32);
  EXPECT_LT(run.spp, run.planned_spp);
}

// Without a pilot there is nothing to choose by.
TEST(Fastest, IsAdaptiveWithoutAPilot) {
  const TempFiles files;
  const Scene lamp = moving_lamp(files);
  const GradientResult run = run_method(lamp, {kLamp}, "fastest", 4, 1);
  EXPECT_EQ(chosen(run), "adaptive: no pilot");
  expect_same_bits(run, run_method(lamp, {kLamp}, "adaptive", 4, 1));
}

TEST(Fastest, HoldsALimitOfTime) {
  const TempFiles files;
  GradientOptions options;
  options.parameters = {kLamp};
  options.method = "fastest";
  options.samples = std::nullopt;
  RunSettings settings;
  settings.spp = 1 << 20;
  settings.seconds = 1;
  const GradientResult run = gradient(moving_lamp(files), options, settings);
  EXPECT_EQ(settings_of(run).count(kRatio), 1u) << chosen(run);
  EXPECT_GT(run.seconds, 0.5);
  EXPECT_LT(run.setup_seconds, run.seconds);
}

}  // namespace
}  // namespace limn
