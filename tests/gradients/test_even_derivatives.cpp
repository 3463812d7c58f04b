// Random numbers that are even in batches: less error, of which the standard errors tell.
#include <gtest/gtest.h>

#include "support/running_mean.h"
#include "support/same_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A square before a lamp, over a floor: what the floor sees of the lamp changes smoothly.
Scene soft_shadow(const TempFiles& files) {
  SceneParts parts;
  parts.width = parts.height = 6;
  parts.body = square("floor", 3, -90, {0, 0, 0}, diffuse("plaster", "0.7, 0.6, 0.5")) +
               square("blocker", 0.4, -90, {0, 1, 0}, diffuse("clay", "0.5, 0.5, 0.5")) +
               square("lamp", 0.8, 90, {0.2, 2.5, 0}, area_light("light", "8, 8, 8"));
  return make_scene(files, parts);
}

struct Errors {
  RunningMean squares;  // of what seeds differ by
  RunningMean surplus;  // of that over what standard errors tell
};

Errors errors_of(const Scene& scene, const std::string& method) {
  constexpr int kSeeds = 32;
  std::vector<Moments> runs;
  for (int seed = 0; seed < kSeeds; ++seed) {
    runs.push_back(
        run_method(scene, {"blocker.translate.x"}, method, 64, seed).parameters[0].total);
  }
  std::vector<double> means(runs[0].size());
  for (const Moments& run : runs) {
    for (size_t i = 0; i < means.size(); ++i) means[i] += run.mean(i) / kSeeds;
  }
  Errors errors;
  for (const Moments& run : runs) {
    double square = 0, told = 0;
    for (size_t i = 0; i < means.size(); ++i) {
      const double deviation = run.mean(i) - means[i];
      square += deviation * deviation * kSeeds / (kSeeds - 1);
      told += run.variance(i);
    }
    errors.squares.add(square);
    errors.surplus.add(square - told);
  }
  return errors;
}

TEST(EvenDerivatives, HaveLessErrorWhichTheyTell) {
  const TempFiles files;
  const Scene scene = soft_shadow(files);
  for (const std::string even : {"adaptive", "fd"}) {
    const Errors errors = errors_of(scene, even);
    EXPECT_GT(errors.squares.mean(), 0) << even;
    EXPECT_LT(std::fabs(errors.surplus.z_score(0)), 4) << even;
    if (even != "adaptive") continue;
    const Errors independent = errors_of(scene, "adaptive:generator=independent");
    EXPECT_LT(std::fabs(independent.surplus.z_score(0)), 4);
    EXPECT_LT(1.3 * errors.squares.mean(), independent.squares.mean());
  }
}

TEST(EvenDerivatives, HaveTheMeanOfOthers) {
  const TempFiles files;
  expect_same_mean(soft_shadow(files), {"blocker.translate.x", "lamp.translate.y"},
                   {"adaptive", "adaptive:generator=independent"});
}

}  // namespace
}  // namespace limn
