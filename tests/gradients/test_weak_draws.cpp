// Draws of edges that weigh little are left to roulette: the mean stays, and the price decides.
#include <gtest/gtest.h>

#include "integrators/estimates/batches.h"
#include "integrators/pilot/allocation.h"
#include "integrators/pilot/term_estimator.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "support/meshes.h"
#include "support/same_mean.h"
#include "support/scenes.h"

namespace limn {
namespace {

// One lane per unit: what is left of the best probability's error and work by others is more.
TEST(WeakDraws, AreTracedWhereItPays) {
  Rng rng(3, 1, 4);
  TracedDraws traced;
  for (int i = 0; i < 5; ++i) traced.add({2, 7, 2 * rng.uniform()});
  const double price = 0.3, units[] = {0.5, 2};
  const Lanes survival = survival_of(traced, price, units);
  const double squared_difference = traced.squared_difference / static_cast<double>(traced.count);
  const double rays = static_cast<double>(traced.rays) / static_cast<double>(traced.count);
  for (int lane = 0; lane < 2; ++lane) {
    for (const double weight : {0.01, 0.1, 0.5}) {
      const double best = survival[lane] * weight;
      ASSERT_LT(best, 1);
      const auto left = [&](double p) {
        return weight * weight * squared_difference / units[lane] / p + price * rays * p;
      };
      for (const double p : {0.9 * best, 1.1 * best}) EXPECT_LT(left(best), left(p));
    }
  }
}

TEST(WeakDraws, AreAllTracedWhereNothingIsKnown) {
  const double units[] = {1, 0};
  EXPECT_TRUE(is_zero(survival_of({}, 1, units)));
  EXPECT_TRUE(is_zero(survival_of({3, 9, 1}, 0, units)));
  EXPECT_TRUE(is_zero(survival_of({3, 9, 0}, 1, {})));
  EXPECT_TRUE(std::isinf(survival_of({3, 9, 1}, 1, units)[1]));
}

// A ball before a sky that changes, in gloss and over a wall.
Scene ball_in_gloss(const TempFiles& files) {
  SceneParts parts;
  parts.width = parts.height = 8;
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, conductor("gloss", 0.3)) +
               square("wall", 2, 0, {0, 1, -1.5}, diffuse("plaster", "0.7, 0.6, 0.5")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(2)), true, 0.6,
                         {0.2, 1, 0}, diffuse("clay", "0.7, 0.5, 0.3")) +
               make_sky(files, "sky");
  return make_scene(files, parts);
}

struct Found {
  std::vector<Moments> images;  // of every parameter
  TermCost cost;
};

// The term `boundary` of two parameters.
Found boundary_of(const Scene& scene, const Lanes& survival, uint64_t seed) {
  const EdgeSamplerType& sampler = edge_sampler_type("silhouettes");
  const auto terms = terms_of(scene, sampler);
  const std::vector<Parameter> parameters = {find_parameter(scene, "ball.translate.x"),
                                             find_parameter(scene, "ball.rotate.z")};
  std::vector<std::unique_ptr<SampleEstimator>> passes;
  passes.push_back(std::make_unique<TermEstimator>(
      scene, parameters, terms, std::vector<bool>(terms.size(), true), sampler, 2));
  auto& estimator = static_cast<TermEstimator&>(*passes[0]);
  SamplePlan plan;
  plan.survival = survival;
  plan.splits = true;
  plan.uniform = SampleCounts(std::vector<double>(terms.size(), 2));
  estimator.set_plan(plan);
  const size_t slot =
      std::find_if(terms.begin(), terms.end(),
                   [](const TermType* type) { return type->name == std::string("boundary"); }) -
      terms.begin();
  constexpr int kBatches = 32, kSamples = 32;
  Found found{{Moments(film_size(scene.film)), Moments(film_size(scene.film))}, {}};
  RunSettings settings;
  const Stopwatch watch;
  ProgressCounter progress(settings, watch, kBatches);
  for (int b = 0; b < kBatches; ++b) {
    const auto sums = run_batch(passes, {seed, kSamples * b, kSamples * (b + 1)}, 2, progress);
    for (size_t k = 0; k < 2; ++k)
      found.images[k].add_batch(sums[0].images[slot * 2 + k], kSamples);
    found.cost.merge(sums[0].costs[slot]);
  }
  return found;
}

TEST(WeakDraws, KeepTheMean) {
  const TempFiles files;
  const Scene scene = ball_in_gloss(files);
  const Found all = boundary_of(scene, {}, 1);
  EXPECT_EQ(all.cost.left_out, 0u);
  // One parameter decides more than the other, or both alike.
  for (const Lanes& survival : {Lanes(3, 0.5, 0, 0), Lanes(0.5, 3, 0, 0), Lanes(1, 1, 0, 0)}) {
    const Found some = boundary_of(scene, survival, 2);
    const uint64_t traced = some.cost.occluded + some.cost.counted;
    EXPECT_GT(some.cost.left_out, traced / 4) << survival[0] << " " << survival[1];
    EXPECT_GT(traced, some.cost.left_out / 8) << survival[0] << " " << survival[1];
    EXPECT_EQ(some.cost.samples, some.cost.no_edge + some.cost.zero_weight + some.cost.left_out +
                                     some.cost.occluded + some.cost.counted);
    for (size_t k = 0; k < 2; ++k) {
      std::vector<double> z;
      const Moments &a = all.images[k], &b = some.images[k];
      for (size_t i = 0; i < a.size(); i += 3) {
        const double error = std::sqrt(a.variance(i) + b.variance(i));
        if (error > 0) z.push_back((a.mean(i) - b.mean(i)) / error);
      }
      const ZSummary summary = summarize(z);
      EXPECT_GE(summary.count, 32);
      EXPECT_GE(summary.p_largest, 1e-6)
          << survival[0] << " " << survival[1] << " " << k << ": " << summary.largest;
      EXPECT_LE(std::fabs(summary.mean) * std::sqrt(static_cast<double>(summary.count)), 5);
    }
  }
}

// A pilot finds some to leave out, and the bits do not depend on threads.
TEST(WeakDraws, AreFoundByAPilot) {
  const TempFiles files;
  const Scene scene = ball_in_gloss(files);
  const std::vector<std::string> parameters = {"ball.translate.x", "ball.rotate.z"};
  const GradientResult one = run_method(scene, parameters, "adaptive", 64, 5, 1);
  const auto boundary = std::find_if(one.terms.begin(), one.terms.end(),
                                     [](const TermRun& term) { return term.name == "boundary"; });
  EXPECT_GT(boundary->cost.left_out, boundary->cost.samples / 20);
  for (const int threads : {2, 3}) {
    expect_same_bits(one, run_method(scene, parameters, "adaptive", 64, 5, threads));
  }
  EXPECT_EQ(run_method(scene, parameters, "forest", 64, 5).terms[2].cost.left_out, 0u);
}

}  // namespace
}  // namespace limn
