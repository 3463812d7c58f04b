// Measures of error on images whose error is known.
#include "limn/integrators/metrics.h"

#include <gtest/gtest.h>

#include <cmath>

#include "limn/core/rng.h"
#include "limn/core/vec.h"
#include "limn/integrators/statistics.h"

namespace limn {
namespace {

// Standard normal numbers (Box and Muller 1958).
std::vector<double> normal_numbers(uint64_t seed, size_t count) {
  Rng rng(seed, 0, 0);
  std::vector<double> values(count);
  for (double& v : values) {
    const double u = 1 - rng.uniform();
    const double angle = 2 * kPi * rng.uniform();
    v = std::sqrt(-2 * std::log(u)) * std::cos(angle);
  }
  return values;
}

// Quantiles of tables, with the normal ones of the same chance. The error goes with the square of
// the degrees.
TEST(Student, IsKnownByItsTables) {
  const struct {
    double degrees, t, z;
  } quantiles[] = {{4, 2.7764, 1.95996},  {4, 7.1732, 3.09023},  {10, 2.2281, 1.95996},
                   {10, 4.1437, 3.09023}, {30, 2.0423, 1.95996}, {30, 3.3852, 3.09023}};
  for (const auto& of : quantiles) {
    EXPECT_NEAR(normal_from_student(of.t, of.degrees), of.z, 0.6 / (of.degrees * of.degrees));
    EXPECT_EQ(normal_from_student(-of.t, of.degrees), -normal_from_student(of.t, of.degrees));
  }
}

std::vector<double> sum(const std::vector<double>& a, double factor, const std::vector<double>& b) {
  std::vector<double> result = a;
  for (size_t i = 0; i < a.size(); ++i) result[i] += factor * b[i];
  return result;
}

TEST(ImageErrors, OfAKnownError) {
  const std::vector<double> reference(3000, 2.0);
  std::vector<double> image(3000, 2.5);
  const std::vector<double> exact(3000, 0.0);
  const ImageErrors even = image_errors(image, reference, exact);
  EXPECT_DOUBLE_EQ(even.mse, 0.25);
  EXPECT_DOUBLE_EQ(even.relative_mse, 0.0625);
  EXPECT_DOUBLE_EQ(even.trimmed_mse, 0.25);
  image[7] = 102;  // one pixel of a thousand
  const ImageErrors outlier = image_errors(image, reference, exact);
  EXPECT_NEAR(outlier.mse, 0.25 + (100.0 * 100 - 0.25) / 3000, 1e-12);
  EXPECT_DOUBLE_EQ(outlier.trimmed_mse, 0.25);
  EXPECT_TRUE(std::isnan(image_errors(image, exact, exact).relative_mse));
}

// The reference's own variance does not count as error of the image.
TEST(ImageErrors, WithoutTheFloorOfTheReference) {
  constexpr size_t kCount = 30000;
  constexpr double kNoise = 0.3, kFloor = 0.5;
  const std::vector<double> truth = normal_numbers(1, kCount);
  const std::vector<double> reference = sum(truth, kFloor, normal_numbers(2, kCount));
  const std::vector<double> variance(kCount, kFloor * kFloor);
  // The square of a normal number of variance v has the variance 2 v^2.
  const auto z = [&](double noise, double mse) {
    const double v = noise * noise + kFloor * kFloor;
    return (mse - noise * noise) / std::sqrt(2 * v * v / kCount);
  };
  const std::vector<double> noisy = sum(truth, kNoise, normal_numbers(3, kCount));
  EXPECT_LT(std::fabs(z(kNoise, image_errors(noisy, reference, variance).mse)), 4.5);
  EXPECT_LT(std::fabs(z(0, image_errors(truth, reference, variance).mse)), 4.5);
}

TEST(Repeats, MeanAndItsError) {
  const Uncertain u = mean_of_repeats({1, 2, 3, 6});
  EXPECT_DOUBLE_EQ(u.value, 3);
  EXPECT_DOUBLE_EQ(u.error, std::sqrt(14.0 / 3 / 4));
  EXPECT_TRUE(std::isnan(mean_of_repeats({5}).error));
}

constexpr size_t kBlocks = 64;
const std::vector<double> kNoEdges(kBlocks, 0.0);

// Repeats of deviation 2 around `bias`, and a reference of deviation 1 around zero.
struct Blocks {
  std::vector<BlockSums> repeats;
  BlockSums reference;
  Blocks(int count, double bias, bool with_variances) {
    reference.sums = normal_numbers(99, kBlocks);
    reference.variances.assign(kBlocks, 1.0);
    reference.degrees = 100;
    for (int r = 0; r < count; ++r) {
      BlockSums block;
      block.sums = sum(std::vector<double>(kBlocks, bias), 2, normal_numbers(10 + r, kBlocks));
      if (with_variances) block.variances.assign(kBlocks, 4.0);
      block.degrees = 100;
      repeats.push_back(block);
    }
  }
  ZSummary summary() const { return summarize(bias_scores(repeats, reference, kNoEdges)); }
};

TEST(Bias, NoneIsPlausible) {
  for (const bool with_variances : {true, false}) {
    const ZSummary z = Blocks(4, 0, with_variances).summary();
    EXPECT_EQ(z.count, static_cast<int>(kBlocks));
    EXPECT_GT(p_value(z), 1e-4) << with_variances;
  }
}

TEST(Bias, IsFound) {
  for (const bool with_variances : {true, false}) {
    EXPECT_LT(p_value(Blocks(4, 3, with_variances).summary()), 1e-6) << with_variances;
  }
}

TEST(Bias, OfOneBlockInNumbers) {
  BlockSums reference{{1.0}, {0.25}, 1e6, 0};
  BlockSums repeat{{4.0}, {2.0}, 1e6, 0};
  // Mean 4 with variance 2 / 2, reference 1 with variance 0.25.
  const auto z = bias_scores({repeat, repeat}, reference, {0.0});
  ASSERT_EQ(z.size(), 1u);
  EXPECT_NEAR(z[0], 3 / std::sqrt(1.25), 1e-4);
  // Edges add 10 to the block by events that stand for a variance of 10 * 0.7.
  repeat.event = 0.7;
  EXPECT_NEAR(bias_scores({repeat, repeat}, reference, {10.0})[0], 3 / std::sqrt(3.75), 1e-4);
}

// A reference that has seen nothing of a block may have missed the few events that rule it.
TEST(Bias, WhereTheReferenceSawNothingItsEventsCount) {
  const BlockSums repeat{{0.002, 4}, {1e-8, 2}, 1e6, 0};
  BlockSums reference{{0, 1}, {0, 0.25}, 1e6, 0};
  const auto scores = [&] { return bias_scores({repeat, repeat}, reference, {0, 0}); };
  EXPECT_GT(scores()[0], 20);
  reference.event = 0.5;
  EXPECT_NEAR(scores()[0], 0.002 / std::sqrt(0.5e-8 + 0.001), 1e-6);
  EXPECT_NEAR(scores()[1], 3 / std::sqrt(1.25), 1e-4);
}

TEST(Bias, OfOneRunWithoutVarianceIsUnknown) {
  EXPECT_EQ(Blocks(1, 0, false).summary().count, 0);
  EXPECT_EQ(Blocks(1, 0, true).summary().count, static_cast<int>(kBlocks));
}

TEST(Bias, EqualBlocksWithoutVarianceSayNothing) {
  const BlockSums exact{{1.0, 2.0}, {0.0, 0.0}, 10, 0};
  EXPECT_TRUE(bias_scores({exact, exact}, exact, {0.0, 0.0}).empty());
}

// Blocks that show nothing but a constant sky differ by rounding, and all alike.
TEST(Bias, RoundingSaysNothing) {
  const BlockSums reference{{1.0}, {1e-34}, 7, 0};
  BlockSums repeat{{1 + 5e-8}, {1e-33}, 7, 0};
  EXPECT_TRUE(bias_scores({repeat, repeat}, reference, {0.0}).empty());
  repeat.sums = {1.001};
  const auto z = bias_scores({repeat, repeat}, reference, {0.0});
  ASSERT_EQ(z.size(), 1u);
  EXPECT_GT(z[0], 5);
}

TEST(Slope, OfAPowerLaw) {
  std::vector<TimedError> runs;
  for (const double t : {0.5, 1.0, 2.0, 4.0}) runs.push_back({t, {3 / t, 0.3 / t}});
  const auto slope = log_log_slope(runs);
  ASSERT_TRUE(slope);
  EXPECT_NEAR(slope->value, -1, 1e-12);
  // Two points: each moves the slope by its relative error over their distance.
  const auto two = log_log_slope({{1, {1.0, 0.1}}, {std::exp(2), {0.5, 0.02}}});
  ASSERT_TRUE(two);
  EXPECT_NEAR(two->error, std::hypot(0.1, 0.04) / 2, 1e-12);
  EXPECT_FALSE(log_log_slope({{1, {1.0, 0.1}}, {2, {-0.1, 0.1}}}));
}

TEST(TimeRatio, WithItsError) {
  const auto ratio = time_ratio({4, 8}, {1, 3});
  ASSERT_TRUE(ratio);
  EXPECT_DOUBLE_EQ(ratio->value, 3);
  EXPECT_DOUBLE_EQ(ratio->error, 3 * std::hypot(2.0 / 6, 1.0 / 2));
  EXPECT_FALSE(time_ratio({4, 8}, {-1, 1}));
  EXPECT_FALSE(time_ratio({}, {1}));
}

}  // namespace
}  // namespace limn
