// How the work is shared among the terms: no choice changes what is estimated, and the pilot's
// choice goes the right way.
#include <gtest/gtest.h>

#include "integrators/pilot/allocation.h"
#include "limn/core/error.h"
#include "limn/core/rng.h"
#include "limn/integrators/check.h"
#include "support/meshes.h"
#include "support/scenes.h"

namespace limn {
namespace {

using PilotFigures = std::vector<TermFigures>;

double error_times_cost(const PilotFigures& f, const SampleCounts& n) {
  double variance = 0;
  double cost = 0;
  for (size_t t = 0; t < f.size(); ++t) {
    variance += f[t].variance / n[t];
    cost += f[t].cost * n[t];
  }
  return variance * cost;
}

// Three terms, the second of which may have less than one sample.
PilotFigures three(TermFigures a, TermFigures b, TermFigures c) {
  b.least = 0.125;
  return {a, b, c};
}

// (sum of sqrt(variance cost))^2, reached where samples ~ sqrt(variance / cost).
double least_product(const PilotFigures& figures) {
  double sum = 0;
  for (const TermFigures& f : figures) sum += std::sqrt(f.variance * f.cost);
  return sum * sum;
}

TEST(BestSamples, AreProportionalToTheRootOfVarianceOverCost) {
  EXPECT_EQ(best_samples(three({1, 1}, {1, 1}, {1, 1})), (SampleCounts{1, 1, 1}));
  EXPECT_EQ(best_samples(three({4, 1}, {1, 1}, {1, 1})), (SampleCounts{2, 1, 1}));
  EXPECT_EQ(best_samples(three({1, 1}, {1, 4}, {9, 1})), (SampleCounts{1, 0.5, 3}));
  EXPECT_EQ(best_samples(three({1, 4}, {4, 1}, {1, 4})), (SampleCounts{1, 4, 1}));
}

TEST(BestSamples, ReachTheLeastErrorWithinTheirRange) {
  Rng rng(1, 2, 3);
  for (int i = 0; i < 200; ++i) {
    PilotFigures figures(3 + i % 2);
    figures[1].least = 0.125;
    // Ratios of counts up to 4.
    for (TermFigures& f : figures) f.variance = std::exp2(4 * rng.uniform()), f.cost = 1;
    const SampleCounts best = best_samples(figures);
    const double least = least_product(figures);
    EXPECT_GE(error_times_cost(figures, best), least * (1 - 1e-12));
    // Rounded to whole numbers, real counts change by factors within [1 / sqrt(2), sqrt(2)]; the
    // product then grows by at most 9 / 8 (Kantorovich's inequality), and by the tie.
    EXPECT_LE(error_times_cost(figures, best), 1.01 * 9 / 8 * least);
  }
}

TEST(BestSamples, AreLimited) {
  EXPECT_EQ(best_samples(three({1e6, 1}, {1, 1}, {1, 1})), (SampleCounts{8, 0.125, 1}));
  EXPECT_EQ(best_samples(three({0, 1}, {0, 1}, {1, 1})), (SampleCounts{1, 0.125, 8}));
  EXPECT_EQ(best_samples(three({1, 1}, {0, 0}, {0, 0})), SampleCounts{});
  EXPECT_EQ(best_samples({}), SampleCounts{});
  EXPECT_EQ(best_samples({{4, 1}, {1, 1}, {1, 1}, {9, 1, 0.125}}), (SampleCounts{2, 1, 1, 3}));
}

TEST(BestSamples, CostNoMoreThanTheyMay) {
  const PilotFigures figures = three({1, 1}, {1, 4}, {9, 1});
  const auto cost = [&](const SampleCounts& n) { return n[0] + 4 * n[1] + n[2]; };
  EXPECT_EQ(best_samples(figures, 6), (SampleCounts{1, 0.5, 3}));  // what they cost anyway
  for (const double most : {5.9, 4.0, 3.0, 2.5}) {
    const SampleCounts best = best_samples(figures, most);
    EXPECT_LE(cost(best), most);
    EXPECT_GT(cost(best), 0.5 * most);
  }
  EXPECT_EQ(best_samples(figures, 2.4), (SampleCounts{1, 0.125, 1}));  // nothing is cheaper
}

TEST(MostWork, IsWhatTheSamplesOfAllPixelsHaveLeft) {
  // 2 samples of 1000 pixels in 3 s, where a unit of work takes 1 ms.
  EXPECT_DOUBLE_EQ(most_work(3, 1e-3, 2, 1000), 1.5);
  EXPECT_EQ(most_work(-1, 1e-3, 2, 1000), 0);
  EXPECT_EQ(most_work(3, 0, 2, 1000), kNoLimit);
}

TEST(PilotSamples, TakeAnEighthOfATimeAndFourWhereThatIsTooShort) {
  EXPECT_EQ(pilot_samples_in_time(32, 0.01, 8, 7), 32);
  EXPECT_EQ(pilot_samples_in_time(32, 0.1, 8, 7), 10);
  EXPECT_EQ(pilot_samples_in_time(32, 0.5, 8, 7), 4);  // three more: 1.5 s of 7
  EXPECT_EQ(pilot_samples_in_time(32, 0.8, 8, 7), 0);
  EXPECT_EQ(pilot_samples_in_time(32, 0.5, 8, 4), 0);
  EXPECT_EQ(pilot_samples_in_time(32, 0.1, 8, -1), 0);
  EXPECT_EQ(pilot_samples_in_time(4, 0.01, 8, 7), 4);
  // All pixels, with as many samples as fit; fewer pixels, down to a few; none.
  const auto expect_size = [](double each, size_t pixels, int spp) {
    const PilotSize size = pilot_size(each, 4096, 32, 1, 7);
    EXPECT_EQ(size.pixels, pixels);
    EXPECT_EQ(size.spp, spp);
  };
  expect_size(0.01 / 4096, 4096, 32);
  expect_size(0.0999 / 4096, 4096, 10);
  expect_size(0.00124, 201, 4);  // 0.25 s for each of four
  expect_size(0.008, 64, 4);
  expect_size(0.01, 0, 0);
}

TEST(PilotSamples, AreFewAndEvenAndNoneForShortJobs) {
  EXPECT_EQ(pilot_samples(7), 0);
  EXPECT_EQ(pilot_samples(8), 4);
  EXPECT_EQ(pilot_samples(128), 16);
  EXPECT_EQ(pilot_samples(1024), 32);
  for (int spp = 8; spp < 100; ++spp) {
    EXPECT_EQ(pilot_samples(spp) % 2, 0);
    EXPECT_LE(std::max(2, std::min(spp / 8, 4)) * pilot_samples(spp), spp);
    EXPECT_EQ(film_pilot_samples(spp) % 8, 0);
    EXPECT_LE(4 * film_pilot_samples(spp), spp);
  }
}

// Two halves of a film of 36 by 12 cells, one with a hundred times the variance of the other.
TEST(SpreadSamples, GoWithTheDeviation) {
  PlanGrid grid;
  grid.columns = 36;
  grid.rows = 12;
  TermFigures term{50.5, 1, 1, std::vector<double>(grid.size(), 1.0)};
  for (size_t i = 0; i < grid.size(); ++i) {
    if (i % 36 < 18) term.cells[i] = 100;
  }
  SamplePlan plan;
  spread_samples({term, {0, 0, 0.125}}, grid, plan);
  ASSERT_EQ(plan.counts.size(), grid.size());
  // Cells whose windows lie in one half. Deviations are 10 and 1, a quarter of their mean 1.4: 7.2,
  // but for rounding to whole numbers. The root of the deviations' ratio would be 3.2.
  const double ratio = plan.counts[0][0] / static_cast<double>(plan.counts[35][0]);
  EXPECT_GE(ratio, 4);
  EXPECT_LE(ratio, 10);
  double sum = 0;
  for (const PixelCounts& counts : plan.counts) sum += counts[0];
  EXPECT_DOUBLE_EQ(plan.uniform[0], sum / static_cast<double>(grid.size()));
}

// One cell in twenty met a large sample by chance. The plan gives more samples there and looks
// good by what it has seen; other samples are as large anywhere.
TEST(SpreadSamples, ExpectNoMoreThanOtherSamplesShow) {
  PlanGrid grid;
  grid.columns = grid.rows = 100;
  TermFigures term{1, 1, 1, std::vector<double>(grid.size(), 0.0)};
  Rng rng(1, 2, 3);
  for (double& cell : term.cells) cell = rng.uniform() < 0.05 ? 20 : 0;
  SamplePlan plan;
  const PlanTotals totals = spread_samples({term}, grid, plan, kNoLimit, true);
  double error = 0;
  for (const PixelCounts& counts : plan.counts) error += 1 / (counts[0] * grid.size());
  EXPECT_LT(totals.error, 0.8 * error);
  EXPECT_NEAR(totals.expected, error, 0.15 * error);
}

// What the first sample of a vertex finds, further ones need not: from one on they are cheap, and
// fewer than one save all of it.
TEST(SpreadSamples, KnowWhatFurtherOnesCost) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  for (const double variance : {0.02, 0.2, 1.0, 5.0}) {
    const auto cells = [&](double v) { return std::vector<double>(grid.size(), v); };
    const std::vector<TermFigures> figures = {{1, 3, 1, cells(1)},
                                              {variance, 10, 0.125, cells(variance), 8}};
    SamplePlan plan;
    const double price = spread_samples(figures, grid, plan).price();
    const auto totals = [&](double a, double b) {
      const double shared = b > 1 ? 8 * (b - 1) : 0;
      return std::array{1 / a + variance / b, 3 * a + 10 * b - shared};
    };
    double least = 1e9;
    for (int a = 1; a <= 24; ++a) {
      for (const double b : {0.125, 0.25, 0.375, 0.5, 0.625, 0.75}) {
        least = std::min(least, totals(a, b)[0] * totals(a, b)[1]);
      }
      for (int b = 1; b <= 24; ++b) least = std::min(least, totals(a, b)[0] * totals(a, b)[1]);
    }
    const auto [error, cost] = totals(plan.counts[0][0], plan.counts[0][1]);
    EXPECT_LE(error * cost, 1.1 * least) << variance;
    EXPECT_NEAR(price, error / cost, 1e-6 * price) << variance;
  }
}

// A term that is left out adds 0: where samples have a mean and hardly vary, that costs more than
// it saves. By brute force over the counts.
TEST(SpreadSamples, KnowWhatIsLostWhereATermIsLeftOut) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  const auto cells = [&](double v) { return std::vector<double>(grid.size(), v); };
  std::vector<double> fewest;
  for (const double squared : {0.0, 0.01, 0.1, 1.0, 10.0}) {
    const double variance = 0.01;
    TermFigures edges{variance, 10, 0.125, cells(variance)};
    edges.squared_mean = squared;
    edges.cells_squared = cells(squared);
    const std::vector<TermFigures> figures = {{1, 3, 1, cells(1)}, edges};
    SamplePlan plan;
    spread_samples(figures, grid, plan);
    const auto product = [&](double a, double b) {
      const double left = b < 1 ? (variance + squared) / b - squared : variance / b;
      return (1 / a + left) * (3 * a + 10 * b);
    };
    double least = 1e9;
    for (int a = 1; a <= 24; ++a) {
      for (double b = 0.125; b < 1; b += 0.0625) least = std::min(least, product(a, b));
      for (int b = 1; b <= 24; ++b) least = std::min(least, product(a, b));
    }
    EXPECT_LE(product(plan.counts[0][0], plan.counts[0][1]), 1.1 * least) << squared;
    // The same of counts that all pixels share.
    const SampleCounts counts = best_samples(figures);
    EXPECT_LE(product(counts[0], counts[1]), 1.1 * least) << squared;
    fewest.push_back(plan.counts[0][1]);
  }
  EXPECT_LT(fewest.front(), 0.75);
  EXPECT_GE(fewest.back(), 1);
}

// Squared means are unbiased: those of all pairs of different samples.
TEST(PilotMoments, HaveTheSquaredMean) {
  Rng rng(4, 0, 0);
  CellSums sums(1, 2);
  std::vector<std::array<double, 3>> samples;
  for (int i = 0; i < 5; ++i) {
    TurnedSample sample;
    for (int c = 0; c < 3; ++c) sample.value[c][1] = rng.uniform();
    samples.push_back({sample.value[0][1], sample.value[1][1], sample.value[2][1]});
    sums.add(0, sample);
  }
  double expected = 0;
  for (int i = 0; i < 5; ++i) {
    for (int j = 0; j < 5; ++j) {
      for (int c = 0; c < 3 && i != j; ++c) expected += samples[i][c] * samples[j][c] / 20;
    }
  }
  const CellCovariances covariances = sums.take(5);
  EXPECT_NEAR(covariances[0].squared_mean(1), expected, 1e-5);
  EXPECT_EQ(covariances[0].squared_mean(0), 0);
}

TEST(SpreadSamples, CostNoMoreThanTheyMay) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  // A few cells of large variance, and a term of the film.
  TermFigures paths{1, 3, 1, std::vector<double>(grid.size(), 1.0)};
  TermFigures edges{20, 10, 0.125, std::vector<double>(grid.size(), 1.0)};
  for (size_t i = 0; i < 20; ++i) edges.cells[i] = 96;
  const std::vector<TermFigures> figures = {paths, edges, {0.5, 1, 0.125}};
  const auto cost_of = [&](double most) {
    SamplePlan plan;
    spread_samples(figures, grid, plan, most);
    double cost = plan.uniform[2];
    for (const PixelCounts& n : plan.counts) cost += 0.01 * (3 * n[0] + 10 * n[1]);
    return cost;
  };
  const double free = cost_of(kNoLimit), least = 3 + 10 * 0.125 + 0.125;
  ASSERT_GT(free, 2.5 * least);  // so that there is something to save
  EXPECT_DOUBLE_EQ(cost_of(1.001 * free), free);
  for (const double most : {0.9 * free, 0.5 * free, 1.5 * least}) {
    EXPECT_LE(cost_of(most), most * (1 + 1e-6));
    EXPECT_GT(cost_of(most), 0.7 * most);
  }
  EXPECT_NEAR(cost_of(0.5 * least), least, 1e-6);  // nothing is cheaper
}

// A simple object before a uniform sky: its outline alone is noisy. By brute force over the counts
// of a path and of the film.
TEST(SpreadSamples, KnowTermsOfTheFilm) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  for (const double of_path : {0.0, 1e-3, 0.1, 2.0}) {
    for (const double cost : {0.05, 1.0, 20.0}) {
      const std::vector<TermFigures> figures = {
          {of_path, 3, 1, std::vector<double>(grid.size(), of_path)}, {1, cost, 0.125}};
      const auto product = [&](double paths, double film) {
        return (of_path / paths + 1 / film) * (3 * paths + cost * film);
      };
      double least = std::numeric_limits<double>::infinity();
      for (int paths = 1; paths <= 64; ++paths) {
        for (double film = 0.125; film <= 64; film *= 1.1)
          least = std::min(least, product(paths, film));
      }
      SamplePlan plan;
      spread_samples(figures, grid, plan);
      // Counts of the film are closer to the best than those of paths.
      const double most = of_path > 0 ? 1.15 : 1.04;
      EXPECT_LE(product(plan.counts[0][0], plan.uniform[1]), most * least)
          << of_path << " " << cost;
    }
  }
}

// Further samples leave what the path does, and stratified ones take out more of the rest. By brute
// force over the counts of a path and of samples at its vertices.
TEST(SpreadSamples, KnowWhatFurtherOnesLeave) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  for (const double kept : {0.0, 0.1, 0.9}) {
    for (const double power : {1.0, 2.0}) {
      for (const double variance : {0.1, 5.0}) {
        const auto cells = [&](double v) { return std::vector<double>(grid.size(), v); };
        const std::vector<TermFigures> figures = {
            {1, 3, 1, cells(1)}, {variance, 1, 0.125, cells(variance), 0, {kept, power}}};
        const auto product = [&](double a, double b) {
          const double left = b > 1 ? kept + (1 - kept) * std::pow(b, -power) : 1 / b;
          return (1 / a + variance * left) * (3 * a + b);
        };
        double least = std::numeric_limits<double>::infinity();
        for (int a = 1; a <= 64; ++a) {
          for (double b = 0.125; b < 1; b *= 1.1) least = std::min(least, product(a, b));
          for (int b = 1; b <= 64; ++b) least = std::min(least, product(a, b));
        }
        SamplePlan plan;
        spread_samples(figures, grid, plan);
        EXPECT_LE(product(plan.counts[0][0], plan.counts[0][1]), 1.1 * least)
            << kept << " " << power << " " << variance;
      }
    }
  }
}

// Lines that are stratified over the film: fewer leave more than their share.
TEST(SpreadSamples, KnowStrataOfTheFilm) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  TermFigures lines{0.01, 3, 0.125};
  lines.shares.power = 2;
  lines.on_film = true;
  const std::vector<TermFigures> figures = {{1, 3, 1, std::vector<double>(grid.size(), 1.0)},
                                            lines};
  const auto product = [&](double paths, double film) {
    return (1 / paths + 0.01 / (film * film)) * (3 * paths + 3 * film);
  };
  double least = std::numeric_limits<double>::infinity();
  for (int paths = 1; paths <= 64; ++paths) {
    for (double film = 0.125; film <= 64; film *= 1.1)
      least = std::min(least, product(paths, film));
  }
  SamplePlan plan;
  spread_samples(figures, grid, plan);
  EXPECT_LE(product(plan.counts[0][0], plan.uniform[1]), 1.1 * least);
}

// Of x_1 = path + e / 2 and x_2 = path + e' / 2^(1 + power / 2), of independent e, e' and paths of
// one distribution.
TEST(PairSums, TellPathsFromDraws) {
  for (const double power : {1.0, 2.0}) {
    PairSums sums(100, 1);
    Rng rng(3, 4, 5);
    const auto centered = [&] { return rng.uniform() - 0.5; };
    for (int i = 0; i < 100000; ++i) {
      const double path = centered(), one = centered() / 2;
      const double two = centered() * std::exp2(-1 - power / 2);
      const auto value = [](double x) { return grey(Lanes{x, 0, 0, 0}); };
      sums.add(i % 100, value(3 + path + one), value(3 + path + two));
    }
    const auto [kept, found] = sums.shares(0);
    EXPECT_NEAR(kept, 0.8, 0.02) << power;
    EXPECT_NEAR(found, power, 0.2) << power;
  }
}

TEST(SpreadSamples, AreEvenWhereNothingVaries) {
  PlanGrid grid;
  grid.columns = grid.rows = 10;
  SamplePlan plan;
  const std::vector<double> ones(grid.size(), 1.0);
  spread_samples({{1, 1, 1, ones}, {9, 1, 1, std::vector<double>(grid.size(), 9.0)}}, grid, plan);
  for (const PixelCounts& counts : plan.counts) {
    EXPECT_EQ(counts, plan.counts[0]);
  }
  // 1 and 3 would be ideal.
  const auto product = [](double a, double b) { return (1 / a + 9 / b) * (a + b); };
  EXPECT_LE(product(plan.counts[0][0], plan.counts[0][1]), 1.1 * product(1, 3));
}

// Indices of the terms of scenes without sharp shadows.
enum Term { kInterior, kCamera, kBoundary };

SceneParts base_scene(const TempFiles& files) {
  SceneParts parts;
  parts.body = ball_over_gloss(files, 0.3);
  return parts;
}

// A black body over a floor under an even sky: nothing slides.
Scene shadow_scene(const TempFiles& files, int ball = 1) {
  SceneParts parts;
  parts.max_depth = 2;
  parts.origin = {0, 3, 3};
  parts.target = {0, 0, 0};
  parts.body = square("floor", 2.5, -90, {0, 0, 0}, diffuse("chalk", "0.8, 0.8, 0.8")) +
               obj_shape("ball", write_mesh(files, "ball.obj", icosphere_mesh(ball)), true, 0.5,
                         {0, 1, 0}, diffuse("soot", "0, 0, 0")) +
               constant_light("sky", "1, 1, 1");
  return make_scene(files, parts);
}

GradientResult run(const Scene& scene, const std::vector<std::string>& parameters,
                   const std::optional<SampleCounts>& samples, const RunSettings& settings,
                   const std::vector<std::string>& terms = {},
                   const std::string& method = "forest") {
  GradientOptions options;
  options.method = method;
  options.parameters = parameters;
  options.samples = samples;
  options.terms = terms;
  return gradient(scene, options, settings);
}

RunSettings run_settings(int spp, int threads = 1) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 5;
  settings.threads = threads;
  return settings;
}

TEST(Choice, GoesTheRightWay) {
  const TempFiles files;
  const Scene lit = make_scene(files, base_scene(files));
  // How bright the lamp is moves no edge: there is one term to choose.
  EXPECT_EQ(run(lit, {"glow.radiance"}, {}, run_settings(64)).terms.size(), 1u);
  // Where nothing slides, edges have all the noise.
  const SampleCounts shadow =
      run(shadow_scene(files), {"ball.translate.y"}, {}, run_settings(64)).samples();
  EXPECT_EQ(shadow[kInterior], 1);
  EXPECT_GE(shadow[kBoundary], 2);
  // Both parameters count.
  EXPECT_GT(
      run(lit, {"ball.translate.x", "glow.radiance"}, {}, run_settings(64)).samples()[kInterior],
      1);
}

// Edges that are listed at a vertex are there for all of its draws, which are many then.
TEST(Choice, KnowsWhatASamplerTakesBesideItsDraws) {
  const TempFiles files;
  const Scene scene = shadow_scene(files, 4);  // of 7680 edges and more
  const GradientResult r = run(scene, {"ball.translate.y"}, {}, run_settings(8), {}, "brute");
  EXPECT_GE(r.samples()[kBoundary], 5);
}

// A choice that is better by its own figures must be better by those of long runs, too.
TEST(Choice, LowersTheErrorForTheWork) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
  const auto product = [&](const SampleCounts& samples) {
    const GradientResult r = run(scene, {"ball.translate.y"}, samples, run_settings(256));
    const Moments& total = r.parameters[0].total;
    double variance = 0;
    for (size_t i = 0; i < total.size(); ++i) variance += total.variance(i);
    double rays = 0;
    for (const TermRun& term : r.terms) rays += static_cast<double>(term.cost.rays);
    return variance * rays;
  };
  const GradientResult chosen = run(scene, {"ball.translate.y"}, {}, run_settings(64));
  EXPECT_FALSE(chosen.samples() == SampleCounts{});
  EXPECT_LT(product(chosen.samples()), product({}));
}

TEST(Choice, IsNotMadeForShortJobsOrOneTerm) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
  const GradientResult brief = run(scene, {"ball.translate.y"}, {}, run_settings(7));
  EXPECT_EQ(brief.samples(), SampleCounts{});
  EXPECT_EQ(brief.pilot_spp, 0);
  const GradientResult alone = run(scene, {"ball.translate.y"}, {}, run_settings(64), {"boundary"});
  EXPECT_EQ(alone.samples(), SampleCounts{});
  EXPECT_EQ(alone.pilot_spp, 0);
}

void expect_same(const Moments& a, const Moments& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a.mean(i), b.mean(i)) << i;
    EXPECT_EQ(a.variance(i), b.variance(i)) << i;
  }
}

void expect_same(const GradientResult& a, const GradientResult& b) {
  EXPECT_EQ(a.samples(), b.samples());
  expect_same(a.radiance, b.radiance);
  for (size_t k = 0; k < a.parameters.size(); ++k) {
    expect_same(a.parameters[k].total, b.parameters[k].total);
    for (size_t t = 0; t < a.terms.size(); ++t) {
      expect_same(a.parameters[k].terms[t], b.parameters[k].terms[t]);
    }
  }
}

// Also of the choice; five parameters take two passes.
TEST(Choice, SameBitsOnAnyNumberOfThreads) {
  const TempFiles files;
  const Scene scene = make_scene(files, base_scene(files));
  const std::vector<std::string> parameters = {"ball.translate.x", "ball.rotate.y", "ball.scale",
                                               "glow.radiance", "sensor.translate.x"};
  const GradientResult one = run(scene, parameters, {}, run_settings(32));
  EXPECT_GT(one.pilot_spp, 0);
  EXPECT_FALSE(one.samples() == SampleCounts{});
  for (const int threads : {2, 7}) {
    expect_same(one, run(scene, parameters, {}, run_settings(32, threads)));
  }
}

// The pilot leaves nothing behind but its choice.
TEST(Choice, GivesTheBitsOfARunWithTheseSamples) {
  const TempFiles files;
  const Scene scene = make_scene(files, base_scene(files));
  const GradientResult chosen = run(scene, {"ball.translate.x"}, {}, run_settings(32));
  expect_same(chosen, run(scene, {"ball.translate.x"}, chosen.samples(), run_settings(32)));

  RunSettings limited = run_settings(1 << 30, 2);
  limited.least_spp = 4;  // two batches however late it is, for variances
  for (const double seconds : {0.3, 1e-9}) {
    limited.seconds = seconds;
    const GradientResult timed = run(scene, {"ball.translate.x"}, {}, limited);
    EXPECT_GE(timed.spp, 4);
    expect_same(timed, run(scene, {"ball.translate.x"}, timed.samples(),
                           run_settings(static_cast<int>(timed.spp))));
  }
}

TEST(Choice, IsLeftWhenInterrupted) {
  const TempFiles files;
  const std::atomic<bool> stop = true;
  RunSettings settings = run_settings(64);
  settings.interrupted = &stop;
  const GradientResult r = run(shadow_scene(files), {"ball.translate.y"}, {}, settings);
  EXPECT_EQ(r.spp, 0);
  EXPECT_EQ(r.samples(), SampleCounts{});
}

// More samples of a term lower its variance as independent samples do, and leave the others as they
// are.
TEST(Samples, OfATermLowerItsVarianceAlone) {
  const TempFiles files;
  const Scene scene = make_scene(files, base_scene(files));
  const auto variances = [&](const SampleCounts& samples) {
    const GradientResult r = run(scene, {"ball.translate.x"}, samples, run_settings(256));
    std::vector<double> sums(r.terms.size());
    for (size_t t = 0; t < sums.size(); ++t) {
      const Moments& term = r.parameters[0].terms[t];
      for (size_t i = 0; i < term.size(); ++i) sums[t] += term.variance(i);
    }
    return sums;
  };
  const auto one = variances({1, 1, 1});
  const auto more = variances({4, 4, 4});
  const auto boundary = variances({1, 1, 4});
  const auto interior = variances({4, 1, 1});
  for (size_t t = 0; t < one.size(); ++t) EXPECT_LT(more[t], one[t]) << t;
  EXPECT_EQ(boundary[kInterior], one[kInterior]);
  EXPECT_EQ(boundary[kCamera], one[kCamera]);
  EXPECT_EQ(boundary[kBoundary], more[kBoundary]);
  EXPECT_EQ(interior[kBoundary], one[kBoundary]);
  EXPECT_EQ(interior[kInterior], more[kInterior]);
}

TEST(Samples, AreCounted) {
  const TempFiles files;
  const Scene scene = make_scene(files, base_scene(files));
  const auto counts = [&](const SampleCounts& samples, const std::vector<std::string>& terms) {
    return run(scene, {"ball.translate.x"}, samples, run_settings(2), terms).terms;
  };
  const uint64_t paths = 16 * 16 * 2;
  const auto one = counts({1, 1, 1}, {});
  const auto more = counts({3, 0.5, 4}, {});
  EXPECT_EQ(more[kInterior].cost.samples, 3 * paths);
  EXPECT_EQ(more[kCamera].cost.samples, paths / 2);
  EXPECT_EQ(more[kBoundary].cost.samples, 4 * one[kBoundary].cost.samples);
  // Without the interior term there is nothing that more paths are good for.
  EXPECT_EQ(counts({3, 1, 4}, {"camera", "boundary"})[kInterior].cost.samples, paths);
}

TEST(Samples, AgreeWithDifferences) {
  const TempFiles files;
  const Scene scene = make_scene(files, base_scene(files));
  CheckOptions options;
  options.parameter = "ball.translate.x";
  options.block = 4;
  for (const auto& samples :
       {std::optional<SampleCounts>{}, std::optional<SampleCounts>{SampleCounts{3, 0.25, 2}}}) {
    options.samples = samples;
    const CheckResult r = check(scene, options, run_settings(256));
    EXPECT_GT(r.windows.count, 0);
    EXPECT_NE(r.verdict, Verdict::kDisagree) << to_string(r.gradient.samples());
  }
}

TEST(Samples, MustBePositive) {
  const TempFiles files;
  const Scene scene = shadow_scene(files);
  for (const SampleCounts& samples :
       {SampleCounts{0, 1, 1}, SampleCounts{1, 0, 1}, SampleCounts{1, 1, -1},
        SampleCounts{1, NAN, 1}, SampleCounts{1, 1, 1.5}, SampleCounts{1, 1, 1, 1}}) {
    EXPECT_THROW(run(scene, {"ball.translate.y"}, samples, run_settings(1)), InputError);
  }
}

}  // namespace
}  // namespace limn
