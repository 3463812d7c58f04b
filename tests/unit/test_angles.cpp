// Angles and half floats against the maths library and the format's definition; draws by weight.
#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <cstdint>
#include <limits>

#include "limn/core/discrete_distribution.h"
#include "limn/core/rng.h"
#include "src/base/angles.h"
#include "src/base/half.h"

namespace limn {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

TEST(Angles, OfVectorsAreThoseOfTheLibrary) {
  Rng rng(1, 2, 3);
  for (int i = 0; i < 200000; ++i) {
    const double size = std::pow(10, 40 * rng.uniform() - 20);
    const double turn = 2 * kPi * rng.uniform();
    // Near an axis every other time.
    const double thin = i % 2 ? 1 : std::pow(10, -16 * rng.uniform());
    const double x = size * std::cos(turn), y = size * thin * std::sin(turn);
    const double expected = std::atan2(y, x);
    EXPECT_NEAR(angle_of(y, x), expected, 2 * kEpsilon * std::fabs(expected)) << y << " " << x;
    EXPECT_NEAR(angle_of(x, y), std::atan2(x, y), 2 * kEpsilon * std::fabs(std::atan2(x, y)));
  }
  for (const double y : {0.0, -0.0, 1.0, -1.0}) {
    for (const double x : {0.0, -0.0, 1.0, -1.0}) {
      EXPECT_DOUBLE_EQ(angle_of(y, x), std::atan2(y, x)) << y << " " << x;
      EXPECT_EQ(std::signbit(angle_of(y, x)), std::signbit(y));
    }
  }
}

TEST(Angles, CarryDerivatives) {
  const Dual y(0.3, {1, 0, 2, 0}), x(-0.7, {0, 1, -1, 0});
  const Dual expected = atan2(y, x), got = angle_of(y, x);
  for (int k = 0; k < kLanes; ++k) EXPECT_DOUBLE_EQ(got.d[k], expected.d[k]);
}

TEST(Angles, SinesAndCosinesAreThoseOfTheLibrary) {
  Rng rng(4, 5, 6);
  for (int i = 0; i < 200000; ++i) {
    const double turns = i <= 16 ? i / 16.0 : rng.uniform();
    const SinCos found = sin_cos_of_turns(turns);
    // The library's argument is rounded: by half a unit in the last place of up to 2 pi.
    const double rounding = 4 * kEpsilon;
    EXPECT_NEAR(found.sin, std::sin(2 * kPi * turns), rounding) << turns;
    EXPECT_NEAR(found.cos, std::cos(2 * kPi * turns), rounding) << turns;
    EXPECT_NEAR(found.sin * found.sin + found.cos * found.cos, 1, 2 * kEpsilon) << turns;
  }
}

TEST(Angles, EightAtOnceAreThoseOfTheLibrary) {
  Rng rng(7, 8, 9);
  for (int i = 0; i < 20000; ++i) {
    double turns[8], x[8], y[8];
    for (int k = 0; k < 8; ++k) {
      turns[k] = i < 3 ? (8 * i + k) / 16.0 : rng.uniform();
      x[k] = rng.uniform() - 0.5, y[k] = rng.uniform() - 0.5;
      if (i % 8 == k) (i % 3 == 0 ? x : y)[k] = i % 2 ? 0.0 : -0.0;
    }
    const auto wide_of = [](const double* v) { return wide::gather([&](int k) { return v[k]; }); };
    const auto found = sin_cos_of_turns(wide_of(turns));
    const wide::Doubles angle = angle_of(wide_of(y), wide_of(x));
    for (int k = 0; k < 8; ++k) {
      const double turn = turns[k] > 1 ? turns[k] - 1 : turns[k];
      EXPECT_NEAR(found.sin[k], std::sin(2 * kPi * turn), 4 * kEpsilon) << turns[k];
      EXPECT_NEAR(found.cos[k], std::cos(2 * kPi * turn), 4 * kEpsilon) << turns[k];
      const double expected = std::atan2(y[k], x[k]);
      EXPECT_NEAR(angle[k], expected, 2 * kEpsilon * std::fabs(expected)) << y[k] << ' ' << x[k];
    }
  }
  const wide::Doubles none = angle_of(wide::Doubles(0.0), wide::Doubles(0.0));
  for (int k = 0; k < 8; ++k) EXPECT_EQ(none[k], 0);
}

// Sign, five bits of exponent, ten of fraction.
double half_value(uint32_t bits) {
  const double sign = bits & 0x8000 ? -1 : 1;
  const auto exponent = static_cast<int>(bits >> 10 & 31);
  const double fraction = (bits & 1023) / 1024.0;
  return sign *
         (exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1 + fraction, exponent - 15));
}

TEST(Halves, HoldEveryFiniteHalfExactly) {
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    if ((bits >> 10 & 31) == 31) continue;
    const auto v = static_cast<float>(half_value(bits));
    const float found = Half(v);
    EXPECT_EQ(found, v);
    EXPECT_EQ(std::signbit(found), std::signbit(v));
  }
}

// The largest exponent too, which means no infinity here.
TEST(Halves, FourAtOnceAreThoseAlone) {
  for (uint32_t i = 0; i < 65536; ++i) {
    std::array<Half, 4> halves;
    for (uint32_t k = 0; k < 4; ++k) {  // each differs from those beside it
      halves[k] = std::bit_cast<Half>(static_cast<uint16_t>(i + 0x4321 * k));
    }
    const FourDoubles found = to_doubles(halves);
    for (int k = 0; k < 4; ++k) {
      EXPECT_EQ(std::bit_cast<uint64_t>(double{found[k]}),
                std::bit_cast<uint64_t>(double{float{halves[k]}}))
          << i << " " << k;
    }
  }
}

// Whoever compares learns that a number is no half.
TEST(Halves, ChangeEverythingElse) {
  Rng rng(7, 8, 9);
  for (int i = 0; i < 100000; ++i) {
    const auto v = static_cast<float>(std::pow(10, 76 * rng.uniform() - 38));
    const double scaled = std::ldexp(v, std::max(-14, std::ilogb(v)) * -1 + 10);
    const bool is_half = v < 131072 && scaled == std::floor(scaled);
    EXPECT_EQ(static_cast<float>(Half(v)) == v, is_half) << v;
  }
  EXPECT_NE(static_cast<float>(Half(131072.0f)), 131072.0f);
  EXPECT_NE(static_cast<float>(Half(1e-10f)), 1e-10f);
}

TEST(DiscreteDistribution, DrawsByWeightAndNothingOfNone) {
  DiscreteDistribution distribution;
  const double weights[] = {0, 1, 0, 3, 0};
  for (const double weight : weights) distribution.add(weight);
  EXPECT_EQ(distribution.sum(), 4);
  int counts[5] = {};
  constexpr int kDraws = 1 << 16;  // exact: bins of equal width
  for (int i = 0; i < kDraws; ++i) {
    const double u = static_cast<double>(i) / kDraws;
    const DiscreteDistribution::Draw draw = distribution.sample(u);
    ++counts[draw.index];
    EXPECT_EQ(draw.probability, weights[draw.index] / 4);
    EXPECT_EQ(draw.fraction, draw.index == 1 ? 4 * u : (4 * u - 1) / 3);
  }
  EXPECT_EQ(counts[1], kDraws / 4);
  EXPECT_EQ(counts[3], kDraws / 4 * 3);
  EXPECT_EQ(distribution.sample(std::nextafter(1.0, 0.0)).index, 3u);
}

}  // namespace
}  // namespace limn
