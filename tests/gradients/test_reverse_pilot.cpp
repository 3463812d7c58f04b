// What a pilot of reverse mode chooses, and that the run behind it is right.
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>

#include "integrators/backward/reverse_pilot.h"
#include "limn/core/image.h"
#include "limn/integrators/backward.h"
#include "limn/integrators/parts.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

// A torus between a lamp and a glossy floor.
Scene shadowed(const TempFiles& files, int width = 32, int height = 32) {
  SceneParts parts;
  parts.width = width;
  parts.height = height;
  parts.max_depth = 3;
  parts.origin = {0, 2.5, 4};
  parts.target = {0, 0.4, 0};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
               obj_shape("body", write_mesh(files, "body.obj", torus_mesh(9, 5)), false, 0.6,
                         {0, 0.9, 0}, diffuse("clay", ".6, .5, .4")) +
               square("lamp", 0.3, 90, {0.5, 3.5, 1}, area_light("glow", "40, 40, 40"));
  return make_scene(files, parts);
}

Image wavy_adjoint(const Scene& scene) {
  Image adjoint(scene.film.crop_width, scene.film.crop_height, 3);
  for (size_t i = 0; i < adjoint.data.size(); ++i)
    adjoint.data[i] = static_cast<float>(std::sin(0.1 * static_cast<double>(i / 3)));
  return adjoint;
}

BackwardOptions options_of(const char* method) {
  BackwardOptions options;
  options.parameters = {"body.translate.x", "body.translate.y", "body.rotate.z"};
  options.method = Method(method);
  return options;
}

BackwardResult run(const Scene& scene, const char* method, int spp, uint64_t seed, int threads = 2,
                   double seconds = 0, int batches = 16) {
  BackwardOptions options = options_of(method);
  options.batches = batches;
  RunSettings settings;
  settings.seconds = seconds;
  settings.spp = spp;
  settings.seed = seed;
  settings.threads = threads;
  return backward(scene, wavy_adjoint(scene), options, settings);
}

std::vector<double> means(const BackwardResult& result) {
  std::vector<double> values;
  for (const ParameterAdjoint& p : result.parameters) values.push_back(p.moments.mean(0));
  return values;
}

TEST(ReversePilot, LeavesShortRunsAlone) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  const BackwardResult chosen = run(scene, "adaptive", 16, 3);
  EXPECT_EQ(chosen.method, "silhouettes");
  EXPECT_EQ(chosen.decision, "");
  EXPECT_EQ(means(chosen), means(run(scene, "silhouettes", 16, 3)));
}

TEST(ReversePilot, ChoosesAlikeOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  const BackwardResult one = run(scene, "adaptive", 96, 3, 1);
  EXPECT_NE(one.decision, "");
  const BackwardResult three = run(scene, "adaptive", 96, 3, 3);
  EXPECT_EQ(one.decision, three.decision);
  EXPECT_EQ(means(one), means(three));
}

// Pilots miss what edges drawn at random meet rarely: a promise of less than half is not enough.
TEST(ReversePilot, ListsSilhouettesUnlessDrawsPromiseHalf) {
  EXPECT_TRUE(lists_silhouettes(1.9, 1));
  EXPECT_FALSE(lists_silhouettes(2.1, 1));
  EXPECT_TRUE(lists_silhouettes(0, 1e-300));
}

// With one sample less than the shortest run with a pilot there is none.
TEST(ReversePilot, BeginsWithTheLeastSamples) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  int spp = 78;
  while (run(scene, "adaptive", spp, 3).decision.empty()) ASSERT_LT(++spp, 96);
  ASSERT_GT(spp, 78);
  EXPECT_EQ(means(run(scene, "adaptive", spp - 1, 3)),
            means(run(scene, "silhouettes", spp - 1, 3)));
}

TEST(ReversePilot, SaysThatNumbersKeepItOff) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  BackwardOptions options = options_of("adaptive");
  options.camera_samples = 1;
  RunSettings settings;
  settings.spp = 2;
  const auto decision = [&] {
    return backward(scene, wavy_adjoint(scene), options, settings).decision;
  };
  EXPECT_EQ(decision(), "no pilot, since sample counts are given: forest");
  options.method = Method("forest");
  EXPECT_EQ(decision(), "");
}

// Every part makes the plan again, and it is that of the run.
TEST(ReversePilot, ChoosesAlikeInParts) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  const BackwardOptions options = options_of("adaptive");
  RunSettings settings;
  settings.spp = 96;
  settings.seed = 3;
  const BackwardResult whole = backward(scene, wavy_adjoint(scene), options, settings);
  ASSERT_NE(whole.decision, "");
  std::vector<std::string> parts;
  for (int part = 1; part <= 2; ++part) {
    PartWriter writer({part, 2}, "", "");
    settings.store = &writer;
    const BackwardResult own = backward(scene, wavy_adjoint(scene), options, settings);
    EXPECT_EQ(own.decision, whole.decision);
    writer.finish();
    parts.push_back(writer.bytes());
  }
  const auto joined = PartReader::of_bytes(parts);
  settings.store = joined.get();
  EXPECT_EQ(means(backward(scene, wavy_adjoint(scene), options, settings)), means(whole));
}

// An interrupted pilot leaves nothing; later, the batches that are done stay as they are.
TEST(ReversePilot, CanBeInterrupted) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  std::atomic<bool> interrupted = true;
  RunSettings settings;
  settings.spp = 96;
  settings.interrupted = &interrupted;
  BackwardOptions options = options_of("adaptive");
  EXPECT_EQ(backward(scene, wavy_adjoint(scene), options, settings).spp, 0);
  interrupted = false;
  std::vector<double> first;
  options.each_batch = [&](int, const auto& sums) {
    first.push_back(sums[0][0]);
    interrupted = first.size() == 2;
  };
  const BackwardResult cut = backward(scene, wavy_adjoint(scene), options, settings);
  EXPECT_NE(cut.decision, "");
  EXPECT_EQ(cut.batches, 2);
  std::vector<double> all;
  options.each_batch = [&](int, const auto& sums) { all.push_back(sums[0][0]); };
  interrupted = false;
  backward(scene, wavy_adjoint(scene), options, settings);
  ASSERT_EQ(first.size(), 2u);
  ASSERT_GT(all.size(), 2u);
  EXPECT_EQ(first, std::vector<double>(all.begin(), all.begin() + 2));
}

// The plan is that of a run without limit that has as many samples, also where the time has room
// for none.
TEST(ReversePilot, ChoosesAlikeInLimitedTime) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  for (const double seconds : {0.01, 4.0}) {
    const BackwardResult timed = run(scene, "adaptive", 100000, 3, 2, seconds);
    const int spp = static_cast<int>(timed.spp);
    const BackwardResult all = run(scene, "adaptive", spp, 3, 2, 0, timed.batches);
    EXPECT_EQ(timed.decision, all.decision) << spp;
    EXPECT_EQ(timed.method, all.method);
    EXPECT_EQ(means(timed), means(all));
  }
}

// Where two samples of a pixel would be enough for a pilot, too.
TEST(ReversePilot, LeavesStandardErrorsInTheShortestTime) {
  const TempFiles files;
  const BackwardResult timed = run(shadowed(files, 256, 200), "adaptive", 100000, 3, 2, 0.001);
  EXPECT_EQ(timed.spp, 2);
}

// `boundary` of `forest` has what `silhouettes` leaves to `direct`: a check compares one of both.
TEST(ReversePilot, IsCheckedByTheTermsThatItTakes) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  BackwardOptions options;
  options.parameters = {"body.translate.x", "body.translate.y"};
  options.method = Method("adaptive");
  options.terms = {"boundary"};
  RunSettings settings;
  settings.spp = 4;
  settings.threads = 2;
  const auto checks = check_reverse(scene, options, settings);
  options.method = Method("forest");
  const auto plain = check_reverse(scene, options, settings);
  ASSERT_EQ(checks.size(), plain.size());
  for (size_t i = 0; i < checks.size(); ++i) {
    EXPECT_EQ(checks[i].forward, plain[i].forward);
    EXPECT_EQ(checks[i].reverse, plain[i].reverse);
  }
}

// Squared error x work, with rays for work, falls by more than pilots can be wrong by; the mean is
// that of `silhouettes`, and error bars are true: six runs' chi-square of Hotelling's kind, each
// parameter by itself, within what has a probability of 1e-4.
TEST(ReversePilot, GainsAndHasTrueErrorBars) {
  const TempFiles files;
  const Scene scene = shadowed(files);
  const BackwardResult truth = run(scene, "silhouettes", 512, 1000);
  constexpr int kRuns = 6, kCompared = 2;
  double usual = 0, squares[3] = {}, own = 0;
  std::string decisions;
  for (int seed = 1; seed <= kRuns; ++seed) {
    const BackwardResult chosen = run(scene, "adaptive", 84, seed);
    const auto work = [](const BackwardResult& result) {
      double rays = 0;
      for (const TermRun& term : result.terms) rays += static_cast<double>(term.cost.rays);
      return rays;
    };
    for (int k = 0; k < 3; ++k) {
      const Moments &b = chosen.parameters[k].moments, &t = truth.parameters[k].moments;
      const double d = b.mean(0) - t.mean(0);
      squares[k] += d * d / (b.variance(0) + t.variance(0));
    }
    decisions += "seed " + std::to_string(seed) + ": " + chosen.decision;
    for (const TermRun& term : chosen.terms)
      decisions += ", " + term.name + " " + std::to_string(term.samples);
    decisions += "\n";
    if (seed > kCompared) continue;
    const BackwardResult plain = run(scene, "forest", 84, seed);
    for (int k = 0; k < 3; ++k) {
      usual += plain.parameters[k].moments.variance(0) * work(plain);
      own += chosen.parameters[k].moments.variance(0) * work(chosen);
    }
  }
  EXPECT_LT(own, 0.5 * usual) << decisions;
  for (const double square : squares) {
    // Of Student's t with 15 degrees of freedom a square has mean 15/13 and variance 3.1: of a sum
    // of six, 7 and 4.3; the bound is at five of them.
    EXPECT_LT(square, 7 + 5 * 4.3);
    EXPECT_GT(square, 0.3);
  }
}

}  // namespace
}  // namespace limn
