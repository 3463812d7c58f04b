// Reconstruction filters: integrals, sampling, and the part of the film where samples may fall.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "limn/core/film.h"
#include "limn/core/rng.h"
#include "limn/core/vec.h"
#include "tests/support/compare_moments.h"

namespace limn {
namespace {

std::vector<Filter> filters() {
  return {{Filter::Kind::kBox, 0.5, 0},
          {Filter::Kind::kTent, 1, 0},
          {Filter::Kind::kTent, 2.5, 0},
          {Filter::Kind::kGaussian, 2, 0.5},
          {Filter::Kind::kGaussian, 4, 1}};
}

// Those that are negative somewhere.
std::vector<Filter> signed_filters() {
  return {cubic_filter(1.0 / 3, 1.0 / 3),
          cubic_filter(0, 0.5),
          cubic_filter(1, 0),
          lanczos_filter(3),
          lanczos_filter(1),
          lanczos_filter(4)};
}
std::vector<Filter> all_filters() {
  std::vector<Filter> all = filters();
  for (const Filter& f : signed_filters()) all.push_back(f);
  return all;
}

// Simpson's rule on each side of 0, where the tent has a kink.
double quadrature(const Filter& f, double a, double b) {
  const int n = 1000;
  double sum = 0;
  for (int i = 0; i < n; ++i) {
    const double x = a + (b - a) * i / n, h = (b - a) / n;
    sum += h / 6 * (f.eval(x) + 4 * f.eval(x + h / 2) + f.eval(x + h));
  }
  return sum;
}

TEST(Filter, IntegralMatchesQuadrature) {
  for (const Filter& f : all_filters()) {
    for (double u : {-0.999, -0.7, -0.2, 0.0, 0.3, 0.9}) {
      const double x = u * f.radius;
      const double expected =
          x <= 0 ? quadrature(f, -f.radius, x) : quadrature(f, -f.radius, 0) + quadrature(f, 0, x);
      // Simpson's error is below (b-a) h^4 max|f''''| / 2880, about 1e-10 here.
      EXPECT_NEAR(f.integral(x), expected, 1e-9);
    }
    EXPECT_EQ(f.integral(-2 * f.radius), 0);
    EXPECT_DOUBLE_EQ(f.integral(2 * f.radius), f.integral(f.radius));
  }
}

TEST(Filter, SlopeMatchesDifferences) {
  for (const Filter& f : all_filters()) {
    for (const double u : {-0.9, -0.3, -1e-4, 0.2, 0.45, 0.7, 0.99}) {
      const double x = u * f.radius, h = 1e-6 * f.radius;
      EXPECT_NEAR(f.slope(x), (f.eval(x + h) - f.eval(x - h)) / (2 * h), 1e-8) << x;
    }
  }
}

// Values of Mitchell and Netravali's paper, and of sines at fractions of pi.
TEST(Filter, ValuesOfNegativeLobes) {
  const Filter mitchell = cubic_filter(1.0 / 3, 1.0 / 3), lanczos = lanczos_filter(3);
  EXPECT_NEAR(mitchell.eval(0), 8.0 / 9, 1e-15);
  EXPECT_NEAR(mitchell.eval(-1), 1.0 / 18, 1e-15);
  EXPECT_NEAR(cubic_filter(0, 0.5).eval(1.5), -1.0 / 16, 1e-15);
  EXPECT_NEAR(lanczos.eval(1.5), -4 / (kPi * kPi) / 3, 1e-15);
  EXPECT_EQ(lanczos.eval(3), 0);
  for (const double x : {0.0, 0.1, 0.37}) {
    double sum = 0;
    for (int m = -2; m <= 2; ++m) sum += mitchell.eval(x + m);
    EXPECT_NEAR(sum, 1, 1e-15);
  }
}

// Samples' weights add up to the filter's integral over every part of the range.
TEST(Filter, WeightsOfSamplesAreTheFilter) {
  constexpr int kParts = 12, kBatches = 500, kOfBatch = 40;
  uint64_t stream = 0;
  for (const Filter& f : signed_filters()) {
    const FilterTable table(f);
    const double r = f.radius;
    for (const auto& [lower, upper] : {std::pair{-r, r}, {-0.5, 0.8 * r}, {-0.5, 0.5}}) {
      const double start = f.integral(lower), total = f.integral(upper) - start;
      std::vector<double> exact(kParts);
      const double width = (upper - lower) / kParts;
      for (int i = 0; i < kParts; ++i) {
        exact[i] = (f.integral(lower + (i + 1) * width) - f.integral(lower + i * width)) / total;
      }
      Rng rng(7, ++stream, 0);
      Moments moments(kParts);
      for (int batch = 0; batch < kBatches; ++batch) {
        std::vector<double> sums(kParts);
        for (int i = 0; i < kOfBatch; ++i) {
          const double x = table.quantile(lower, upper, rng.uniform());
          const auto part = static_cast<int>((x - lower) / width);
          sums[std::clamp(part, 0, kParts - 1)] += table.weight(lower, upper, x);
        }
        moments.add_batch(sums, kOfBatch);
      }
      EXPECT_GE(compare_moments(moments, exact).p_largest, 1e-5);
    }
  }
}

// Kolmogorov-Smirnov: sqrt(n) sup |F_n - F| exceeds 1.95 with probability 1e-3; with 15 cases and
// fixed seeds 2.3 has a chance of 1e-3 in all.
TEST(Filter, SamplesFollowTheFilter) {
  const size_t n = 20000;
  uint64_t stream = 0;
  for (const Filter& f : filters()) {
    const FilterTable table(f);
    const double r = f.radius;
    for (const auto& [lower, upper] : {std::pair{-r, r}, {-0.3 * r, 0.1 * r}, {0.6 * r, r}}) {
      Rng rng(7, ++stream, 0);
      std::vector<double> x(n);
      for (double& v : x) v = table.quantile(lower, upper, rng.uniform());
      std::sort(x.begin(), x.end());
      EXPECT_GE(x.front(), lower);
      EXPECT_LE(x.back(), upper);
      const double start = f.integral(lower), total = f.integral(upper) - start;
      double distance = 0;
      for (size_t i = 0; i < n; ++i) {
        const double cdf = (f.integral(x[i]) - start) / total;
        distance = std::max(
            {distance, std::fabs(cdf - double(i) / n), std::fabs(cdf - double(i + 1) / n)});
      }
      EXPECT_LT(std::sqrt(double(n)) * distance, 2.3);
    }
  }
}

// The inverse is exact: integrating up to a quantile gives the part back, of the whole filter and
// of pieces of it, by Newton's method and from the table.
TEST(Filter, QuantilesInvertTheIntegral) {
  for (const Filter& f : filters()) {
    const FilterTable table(f);
    const double r = f.radius;
    for (const auto& [lower, upper] : {std::pair{-r, r}, {-0.3 * r, 0.1 * r}, {0.6 * r, r}}) {
      const double start = f.integral(lower), total = f.integral(upper) - start;
      Rng rng(3, 0, 0);
      for (int i = 0; i < 2000; ++i) {
        // Ends, where the filter goes to zero, are as likely as the middle.
        const double near = std::pow(10.0, -12 * rng.uniform());
        const double u = i % 3 == 0 ? rng.uniform() : i % 3 == 1 ? near : 1 - near;
        for (const double x : {f.quantile(lower, upper, u), table.quantile(lower, upper, u)}) {
          EXPECT_NEAR((f.integral(x) - start) / total, u, 4e-15 * f.integral(r) / total);
        }
      }
      EXPECT_NEAR(table.quantile(lower, upper, 0), lower, 1e-7 * r);
    }
  }
}

TEST(Film, SamplesStayInTheCropUnlessTheBorderIsSampled) {
  Film film;
  film.crop_x = 10;
  film.crop_width = 4;
  film.crop_y = 0;
  film.crop_height = 100;
  EXPECT_DOUBLE_EQ(film.range_x(10).lower, -0.5);
  EXPECT_DOUBLE_EQ(film.range_x(10).upper, 2);
  EXPECT_DOUBLE_EQ(film.range_x(13).lower, -2);
  EXPECT_DOUBLE_EQ(film.range_x(13).upper, 0.5);
  EXPECT_DOUBLE_EQ(film.range_x(12).upper, 1.5);
  EXPECT_DOUBLE_EQ(film.range_y(50).lower, -2);
  EXPECT_DOUBLE_EQ(film.range_y(99).upper, 0.5);
  film.sample_border = true;
  EXPECT_DOUBLE_EQ(film.range_x(10).lower, -2);
}

}  // namespace
}  // namespace limn
