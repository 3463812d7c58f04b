// Moving directions: whatever they do, the mean stays; and where they are meant for, they take out
// most of the variance.
#include <gtest/gtest.h>

#include "limn/integrators/gradient.h"
#include "limn/integrators/methods.h"
#include "limn/integrators/statistics.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

constexpr int kBlock = 4;

// A ball over a glossy floor between a lamp and a sky.
Scene gloss_scene(const TempFiles& files, double alpha) {
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", alpha)) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               square("lamp", 0.5, 90, {0.3, 2.4, 0.5}, area_light("glow", "6, 5, 4")) +
               make_sky(files, "sky");
  return make_scene(files, parts);
}

GradientResult run(const Scene& scene, const std::vector<std::string>& parameters,
                   const std::string& method, int spp, uint64_t seed, int threads = 0,
                   const std::vector<std::string>& terms = {}) {
  GradientOptions options;
  options.parameters = parameters;
  options.method = method;
  options.samples = std::nullopt;
  options.terms = terms;
  options.block = kBlock;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads > 0 ? threads : 2;
  return gradient(scene, options, settings);
}

double mean_variance(const Moments& moments) {
  double sum = 0;
  for (size_t i = 0; i < moments.size(); ++i) sum += moments.variance(i);
  return sum / static_cast<double>(moments.size());
}

// z-scores of the differences of block sums between a method and the plain forest.
void expect_same_mean(const Scene& scene, const std::string& parameter, const std::string& method) {
  const Moments a = run(scene, {parameter}, "forest", 256, 1).parameters[0].total_blocks;
  const Moments b = run(scene, {parameter}, method, 256, 2).parameters[0].total_blocks;
  std::vector<double> z;
  for (size_t i = 0; i < a.size(); ++i) {
    const double variance = a.variance(i) + b.variance(i);
    if (variance > 0) z.push_back((a.mean(i) - b.mean(i)) / std::sqrt(variance));
  }
  const ZSummary summary = summarize(z);
  EXPECT_GE(summary.count, 4);
  EXPECT_GE(summary.p_largest, 1e-6) << method << " " << parameter << ": " << summary.largest;
  EXPECT_LE(std::fabs(summary.mean) * std::sqrt(static_cast<double>(summary.count)), 5)
      << method << " " << parameter;
}

TEST(MovingDirections, KeepTheMean) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.2);
  for (const char* parameter : {"ball.translate.x", "ball.rotate.y", "lamp.translate.x",
                                "sensor.translate.y", "sensor.rotate.x", "floor.translate.y"}) {
    for (const char* method : {"random-directions", "moving-directions", "adaptive"}) {
      expect_same_mean(scene, parameter, method);
    }
  }
}

// The edges of a point light's shadows, seen in gloss, move against directions that turn. One pixel:
// each seed is one turn.
TEST(MovingDirections, KeepTheMeanOfSharpShadows) {
  const Scene scene = read_scene(
      std::string(LIMN_SOURCE_DIR) + "/scenes/closed_form/shadow_in_gloss.xml", {}, nullptr);
  const auto estimate = [&](const std::string& method, int spp, uint64_t seed) {
    GradientOptions options;
    options.parameters = {"object.translate.x"};
    options.method = method;
    options.samples = SampleCounts{1, 0.5, 1, 4};
    RunSettings settings;
    settings.spp = spp;
    settings.seed = seed;
    return gradient(scene, options, settings).parameters[0].image_sum;
  };
  const Moments held = estimate("forest", 32768, 1);
  std::vector<double> z;
  for (uint64_t seed = 1; seed <= 6; ++seed) {
    const Moments turned = estimate("random-directions", 16384, seed);
    z.push_back((turned.mean(0) - held.mean(0)) / std::sqrt(turned.variance(0) + held.variance(0)));
  }
  EXPECT_GE(summarize(z).p_largest, 1e-4) << summarize(z).largest;
}

TEST(MovingDirections, TakeOutWhatSlides) {
  const TempFiles files;
  SceneParts parts;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.1)) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), false, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               make_sky(files, "sky");
  const Scene scene = make_scene(files, parts);
  const auto variance = [&](const std::string& method) {
    return mean_variance(run(scene, {"ball.translate.y"}, method, 128, 3).parameters[0].total);
  };
  EXPECT_LT(2 * variance("moving-directions"), variance("forest"));
}

// With some terms left out nothing would take back what directions add to the others.
TEST(MovingDirections, RestWhereTermsAreLeftOut) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.2);
  const auto interior = [&](const std::string& method) {
    const GradientResult result =
        run(scene, {"ball.translate.y"}, method, 64, 3, 0, {"interior", "camera"});
    return result.parameters[0].total;
  };
  const Moments a = interior("forest"), b = interior("random-directions");
  for (size_t i = 0; i < a.size(); ++i) ASSERT_EQ(a.mean(i), b.mean(i));
}

TEST(MovingDirections, SameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = gloss_scene(files, 0.1);
  for (const std::vector<std::string>& parameters :
       {std::vector<std::string>{"ball.translate.y"},
        std::vector<std::string>{"ball.translate.y", "ball.rotate.x", "sensor.translate.x"}}) {
    const GradientResult one = run(scene, parameters, "adaptive", 32, 5, 1);
    EXPECT_GT(one.pilot_spp, 0);
    for (const int threads : {2, 5}) {
      const GradientResult many = run(scene, parameters, "adaptive", 32, 5, threads);
      for (size_t k = 0; k < parameters.size(); ++k) {
        const Moments &a = one.parameters[k].total, &b = many.parameters[k].total;
        for (size_t i = 0; i < a.size(); ++i) {
          ASSERT_EQ(a.mean(i), b.mean(i));
          ASSERT_EQ(a.variance(i), b.variance(i));
        }
      }
    }
  }
}

}  // namespace
}  // namespace limn
