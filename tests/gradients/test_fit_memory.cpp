// Images that fits carry from step to step: their means by z-scores, their noise, and bits.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "integrators/fit/running_images.h"
#include "limn/core/error.h"
#include "limn/core/parameter.h"
#include "limn/integrators/fit.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

Scene lit_body(const TempFiles& files) {
  SceneParts parts;
  parts.width = parts.height = 12;
  parts.origin = {0, 2, 4};
  const std::string mesh = write_mesh(files, "body.obj", icosphere_mesh(1));
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               obj_shape("body", mesh, false, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", 0.8, 90, {0.5, 3.5, 1}, area_light("glow", "6, 6, 6"));
  return make_scene(files, parts);
}

FitView view_of(const Scene& scene) {
  Image target(12, 12, 3);
  for (size_t i = 0; i < target.data.size(); ++i) target.data[i] = 0.1f * (i % 7);
  return {deep_copy(scene), target, {}};
}

// Chains over a scene whose body moves by a given way: no step depends on noise.
TEST(RunningImages, HaveTheMeanOfTheSceneAndLessNoise) {
  constexpr int kChains = 40, kSteps = 12;
  const TempFiles files;
  Scene scene = lit_body(files);
  const Parameter along = find_parameter(scene, "body.translate.x");
  std::vector<Scene> way;
  for (int t = 0; t < kSteps; ++t) {
    way.push_back(deep_copy(scene));
    along.move(scene, 0.01);
  }
  RunSettings settings;
  settings.spp = 4096;
  settings.seed = 77;
  const RenderResult exact = render(way.back(), settings, {});
  settings.spp = 4;
  const size_t size = exact.radiance.size();
  std::vector<double> sums(size), squares(size);
  double carried = 0, fresh = 0;
  for (int chain = 0; chain < kChains; ++chain) {
    RunningImages images({});
    for (int t = 0; t < kSteps; ++t) {
      settings.seed = mix_bits(1000 * chain + t);
      if (t == 0) {
        ASSERT_TRUE(images.pair(way[t], settings));
      } else {
        ASSERT_TRUE(images.carry(way[t], settings));
      }
    }
    const ImagePair& pair = *images.pair(way.back(), settings);
    const RenderResult alone = render(way.back(), settings, {});
    for (size_t i = 0; i < size; ++i) {
      const double mean = 0.5 * (pair.a[i] + pair.b[i]);
      sums[i] += mean;
      squares[i] += mean * mean;
      carried += std::pow(pair.a[i] - exact.radiance.mean(i), 2);
      fresh += std::pow(alone.radiance.mean(i) - exact.radiance.mean(i), 2);
    }
  }
  EXPECT_LT(carried, 0.4 * fresh);
  // Of the whole image, and of each half of its blocks of pixels.
  for (const int part : {0, 1, 2}) {
    double off = 0, variance = 0;
    for (size_t i = 0; i < size; ++i) {
      if (part > 0 && static_cast<int>(i / 36 % 2) == part - 1) continue;
      const double mean = sums[i] / kChains;
      off += mean - exact.radiance.mean(i);
      variance += (squares[i] / kChains - mean * mean) / (kChains - 1) + exact.radiance.variance(i);
    }
    // Channels of a pixel are alike: three times the variance of independent ones.
    EXPECT_LT(std::fabs(off), 4 * std::sqrt(3 * variance)) << part;
  }
}

FitOptions carrying() {
  FitOptions options;
  options.parameters = {"body.vertex_positions", "clay.reflectance"};
  options.carry_images = true;
  return options;
}

TEST(RunningImages, NeitherThreadsNorABreakChangeABit) {
  const TempFiles files;
  const std::vector<FitView> views{view_of(lit_body(files)), view_of(lit_body(files))};
  RunSettings settings;
  settings.spp = 2;
  std::vector<double> losses;
  Fit whole(views, carrying(), settings);
  for (int i = 0; i < 5; ++i) losses.push_back(whole.step().value().loss);
  settings.threads = 2;
  for (const int pause : {0, 2, 4}) {
    Fit first(views, carrying(), settings), second(views, carrying(), settings);
    for (int i = 0; i < pause; ++i) ASSERT_TRUE(first.step());
    second.restore(first.state());
    for (int i = pause; i < 5; ++i) EXPECT_EQ(second.step().value().loss, losses[i]) << pause;
    EXPECT_EQ(second.state().views[1].images, whole.state().views[1].images);
  }
  FitState other = whole.state();
  other.views[0].images.pop_back();
  EXPECT_THROW(Fit(views, carrying(), settings).restore(other), InputError);
}

// Also after the step itself, while images are carried on.
TEST(RunningImages, AnInterruptedStepLeavesNothing) {
  const TempFiles files;
  const std::vector<FitView> views{view_of(lit_body(files))};
  RunSettings settings;
  settings.spp = 2;
  Fit whole(views, carrying(), settings);
  ASSERT_TRUE(whole.step());
  const double second = whole.step().value().loss;
  std::atomic<bool> stop = false;
  Fit fit(views, carrying(), settings);
  ASSERT_TRUE(fit.step());
  const FitState before = fit.state();
  // The last call comes with the end of the gradient.
  fit.listen([&](double done) { stop = done >= 1; }, &stop);
  EXPECT_FALSE(fit.step());
  EXPECT_EQ(fit.steps(), 1);
  EXPECT_EQ(fit.state().views[0].shapes[0].positions, before.views[0].shapes[0].positions);
  EXPECT_EQ(fit.state().views[0].images, before.views[0].images);
  fit.listen(nullptr, nullptr);
  EXPECT_EQ(fit.step().value().loss, second);
}

TEST(RunningImages, AreCheckedAgainstNewOnes) {
  const TempFiles files;
  const std::vector<FitView> views{view_of(lit_body(files))};
  FitOptions options = carrying();
  options.check_steps = 3;
  RunSettings settings;
  settings.spp = 2;
  double squares = 0;
  int checks = 0;
  for (uint64_t seed = 0; seed < 8; ++seed) {
    settings.seed = seed;
    Fit fit(views, options, settings);
    for (int i = 0; i < 7; ++i) {
      const FitRecord record = fit.step().value();
      EXPECT_EQ(record.check.has_value(), i % 3 == 0);
      if (!record.check) continue;
      squares += std::pow(record.check->brightness, 2);
      ++checks;
    }
  }
  // A chi-square of as many degrees; but blocks are few, and their squares bounded by them.
  EXPECT_LT(squares, checks + 4 * std::sqrt(2.0 * checks));
  EXPECT_GT(squares, checks - 4 * std::sqrt(2.0 * checks));
}

// Importances of the sky are kept from step to step, but not where a fit changes it.
TEST(RunningImages, AFitThatMovesTheSkyDrawsByTheNewOne) {
  const TempFiles files;
  SceneParts parts;
  parts.width = parts.height = 12;
  parts.origin = {0, 2, 4};
  Image map(8, 4, 3);
  for (size_t i = 0; i < map.data.size(); ++i) map.data[i] = 0.1f * static_cast<float>(i % 11);
  write_exr(files.path("map.exr"), map, false, {});
  const std::string mesh = write_mesh(files, "body.obj", icosphere_mesh(1));
  parts.body = obj_shape("body", mesh, false, 0.6, {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("floor", 2.5, -90, {0, 0, 0}, diffuse("grey", ".5, .5, .5")) +
               R"(<emitter type="envmap" id="sky"><string name="filename" value=")" +
               files.path("map.exr") + R"("/></emitter>)";
  const std::vector<FitView> views{view_of(make_scene(files, parts))};
  RunSettings settings;
  settings.spp = 2;
  for (const char* sky : {"sky.data", "sky.scale"}) {
    FitOptions options;
    options.parameters = {"body.vertex_positions", sky};
    options.step = 20;
    Fit whole(views, options, settings), other(views, options, settings);
    ASSERT_TRUE(whole.step());
    other.restore(whole.state());
    ASSERT_TRUE(whole.step() && other.step());
    EXPECT_EQ(whole.state().views[0].shapes[0].positions,
              other.state().views[0].shapes[0].positions)
        << sky;
  }
}

TEST(RunningImages, AreNotForFitsWithoutNoise) {
  const TempFiles files;
  FitOptions options = carrying();
  const auto refused = [&](const Scene& scene, const char* text) {
    try {
      const Fit fit({view_of(scene)}, options, {});
      ADD_FAILURE() << "no error";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(text), std::string::npos) << error.what();
    }
  };
  options.backward.method = "analytic";
  options.backward.points = FilmPoints::kFaces;
  Scene direct = lit_body(files);
  direct.max_depth = 2;
  refused(direct, "leave out --memory images");
  options = carrying();
  options.carry_images = false;
  options.check_steps = 2;
  refused(direct, "add --memory images");
}

}  // namespace
}  // namespace limn
