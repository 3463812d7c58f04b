// Environments: look-up, orientation, derivatives, reading.
#include "limn/core/environment.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "limn/core/rng.h"
#include "src/base/angles.h"
#include "src/light/map_density.h"
#include "support/environment_maps.h"
#include "support/quadrature.h"

namespace limn {
namespace {

using test::make_envmap;
using test::MapCase;
using test::TestProperties;

// Red counts columns, green is 1 beside the seam, blue counts rows.
Image compass() {
  Image image(64, 33, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      image.at(x, y, 0) = static_cast<float>(x);
      image.at(x, y, 1) = x == 0 || x == 63 ? 1.0f : 0.0f;
      image.at(x, y, 2) = static_cast<float>(y);
    }
  }
  return image;
}

void expect_compass(const Rgb<double>& c, double column, double seam, double row) {
  EXPECT_NEAR(c.r, column, 1e-12);
  EXPECT_NEAR(c.g, seam, 1e-12);
  EXPECT_NEAR(c.b, row, 1e-12);
}

TEST(Environment, MapIsOrientedAsInMitsuba) {
  const auto map = make_envmap(compass());
  expect_compass(map->radiance(Vec3d{0, 0, 1}), 31.5, 0, 16);   // the center of the image
  expect_compass(map->radiance(Vec3d{1, 0, 0}), 15.5, 0, 16);   // a quarter from the left
  expect_compass(map->radiance(Vec3d{-1, 0, 0}), 47.5, 0, 16);  // a quarter from the right
  expect_compass(map->radiance(Vec3d{0, 0, -1}), 31.5, 1, 16);  // the seam: columns 0 and 63
  EXPECT_NEAR(map->radiance(Vec3d{0, 1, 0}).b, 0, 1e-12);       // the top row
  EXPECT_NEAR(map->radiance(Vec3d{0, -1, 0}).b, 32, 1e-12);
}

// To rounding; to the bit, however many go beside a direction. Radiance there is that of the
// direction.
TEST(Environment, DirectionsFoundAtOnceAreThoseAlone) {
  const auto map = make_envmap(compass());
  Rng rng(3, 4, 5);
  std::vector<Vec3d> directions{{0, 0, -1}, {0, 1, 0}, {0, -1, 0}, {1, 0, 0}};
  while (directions.size() < 21) {
    directions.push_back(test::map_direction(rng.uniform(), rng.uniform()));
  }
  const auto find = [&](size_t first, size_t count) {
    std::vector<std::array<double, 2>> places(count);
    std::vector<Environment::Found> found;
    for (size_t i = 0; i < count; ++i) found.push_back({&directions[first + i], &places[i]});
    map->find_each(found);
    return places;
  };
  const auto together = find(0, directions.size());
  for (size_t i = 0; i < directions.size(); ++i) {
    EXPECT_EQ(find(i, 1)[0], together[i]);
    const auto alone = map->find(directions[i]);
    EXPECT_NEAR(std::remainder(together[i][0] - alone[0], 64), 0, 1e-12);
    EXPECT_NEAR(together[i][1], alone[1], 1e-12);
    const Rgb<double> there = map->radiance_at(directions[i], together[i]);
    const Rgb<double> radiance = map->radiance(directions[i]);
    for (int c = 0; c < 3; ++c) EXPECT_NEAR(there[c], radiance[c], 1e-10);
  }
}

TEST(Environment, TexelCentresGiveTexels) {
  const Image image = compass();
  const auto map = make_envmap(image);
  for (int y = 1; y < 32; y += 3) {
    for (int x = 0; x < 64; x += 5) {
      const Rgb<double> c = map->radiance(test::map_direction((x + 0.5) / 64, y / 32.0));
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(c[i], image.at(x, y, i), 1e-11);
    }
  }
}

// A quarter turn about x makes +Z the top of the map, for scenes with z up.
TEST(Environment, ToWorldTurnsTheMap) {
  Matrix4 m;
  m.m[1][1] = m.m[2][2] = 0;
  m.m[1][2] = -3;  // one factor for all axes changes no direction
  m.m[2][1] = 3;
  m.m[0][0] = 3;
  const auto map = make_envmap(compass(), 1, m);
  EXPECT_NEAR(map->radiance(Vec3d{0, 0, 1}).b, 0, 1e-12);
  EXPECT_NEAR(map->radiance(Vec3d{0, 0, -1}).b, 32, 1e-12);
  expect_compass(map->radiance(Vec3d{0, -1, 0}), 31.5, 0, 16);
  expect_compass(map->radiance(Vec3d{1, 0, 0}), 15.5, 0, 16);
}

// Mitsuba 3.9.1, variant scalar_rgb: the map below, scale 2, to_world = rotation by 40 degrees
// about (2, -1, 2) / 3.
TEST(Environment, MatchesMitsuba) {
  Image image(5, 4, 3);
  image.data = {0.805, 0.808, 0.515, 0.805, 0.808, 0.515, 0.805, 0.808, 0.515, 0.805, 0.808, 0.515,
                0.805, 0.808, 0.515, 0.844, 0.392, 0.493, 0.677, 0.061, 0.556, 0.271, 0.88,  0.064,
                0.679, 0.87,  0.227, 0.895, 0.872, 0.019, 0.707, 0.001, 0.503, 0.437, 0.203, 0.325,
                0.806, 0.316, 0.149, 0.699, 0.449, 0.799, 0.236, 0.32,  0.8,   0.507, 0.506, 0.236,
                0.507, 0.506, 0.236, 0.507, 0.506, 0.236, 0.507, 0.506, 0.236, 0.507, 0.506, 0.236};
  const struct {
    Vec3d d;
    Rgb<double> radiance;
  } references[] = {
      {{-0.905751169, 0.209495977, 0.368410438}, {1.34954619, 1.70540833, 0.591008067}},
      {{-0.525928795, -0.643439949, -0.556222856}, {1.08520889, 0.840648234, 1.55126786}},
      {{-0.219617128, -0.578146756, -0.785821021}, {0.82027632, 0.775383592, 1.40371203}},
      {{-0.687129557, 0.674191833, 0.27077359}, {1.57828844, 1.64719987, 0.85645318}},
      {{0.276354253, 0.75310266, 0.597046673}, {1.44007075, 0.514773726, 1.08281231}},
      {{0.289438337, -0.931787789, -0.219082177}, {1.14707303, 0.945562959, 0.605825126}},
      {{-0.222178638, -0.945247114, -0.239049256}, {1.30040622, 0.916080892, 1.20813191}},
      {{0.90816617, -0.352977633, 0.225035608}, {0.912686169, 0.503636062, 0.614603519}},
      {{-0.0299163088, -0.179223433, 0.983353436}, {0.899123967, 1.23081148, 0.321357816}},
      {{0.450720817, 0.644447625, 0.617687643}, {1.38815296, 0.218708366, 1.09954464}},
      {{0.520858347, -0.739876688, 0.425780535}, {1.28533471, 0.649559975, 0.430581182}},
      {{-0.925934255, -0.321901172, -0.197548509}, {1.35597301, 1.39431512, 0.853389621}},
      {{0.965420127, -0.257450849, -0.0410244949}, {1.01858103, 0.452995181, 0.68630743}},
      {{-0.760161102, 0.53722018, -0.365444332}, {1.69144905, 1.72038805, 0.279998064}},
  };
  const auto map = make_envmap(image, 2, test::some_rotation());
  for (const auto& r : references) {
    const Rgb<double> c = map->radiance(r.d);
    // Single precision of u and w, times the slope of at most 2 per texel.
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(c[i], r.radiance[i], 32 * std::numeric_limits<float>::epsilon());
    }
  }
}

TEST(Environment, IsContinuousAcrossSeamAndTexels) {
  const auto map = make_envmap(test::map_cases()[9].image);
  for (double w : {0.2, 0.5, 0.75}) {
    for (int x = 0; x <= 8; ++x) {
      const double u = (x + 0.5) / 8;
      const double before = map->radiance(test::map_direction(u - 1e-9, w)).r;
      EXPECT_NEAR(map->radiance(test::map_direction(u + 1e-9, w)).r, before, 1e-6);
    }
    const double before = map->radiance(test::map_direction(-1e-9, w)).r;
    EXPECT_NEAR(map->radiance(test::map_direction(1e-9, w)).r, before, 1e-6);
  }
}

TEST(Environment, DerivativesMatchDifferences) {
  const auto map = make_envmap(compass(), 1.5, test::some_rotation());
  Rng rng(1, 2, 3);
  for (int i = 0; i < 50; ++i) {
    const double u1 = rng.uniform();
    const double u2 = rng.uniform();
    const Vec3d d = test::map_direction(u1, 0.05 + 0.9 * u2);
    const Vec3d velocity = cross(d, Vec3d{0.3, -0.7, 0.4});
    const auto at = [&](double t) { return map->radiance(normalize(d + velocity * t)); };
    const Rgb<Dual> c =
        map->radiance(normalize(Vec3<Dual>{d.x, d.y, d.z} + velocity * Dual(0, {0, 1, 0, 0})));
    const double h = 1e-6;
    const Rgb<double> expected = (at(h) - at(-h)) * (0.5 / h);
    for (int k = 0; k < 3; ++k) {
      EXPECT_NEAR(c[k].d[1], expected[k], 1e-6 * (1 + std::fabs(expected[k])));
    }
  }
}

TEST(Environment, ParametersScaleRadiance) {
  const auto map = make_envmap(compass(), 1.5);
  const auto copy = map->clone();
  ASSERT_EQ(copy->parameters()[0].name, "scale");
  copy->parameters()[0].values[0]->d[3] = 1;
  const Rgb<Dual> c = copy->radiance(Vec3<Dual>{0., 0., 1.});
  EXPECT_DOUBLE_EQ(c.b.v, 24);
  EXPECT_DOUBLE_EQ(c.b.d[3], 16);
  EXPECT_EQ(map->radiance(Vec3<Dual>{0., 0., 1.}).b.d[3], 0);
  const auto constant = make_constant_environment({1, 2, 3});
  ASSERT_EQ(constant->parameters()[0].name, "radiance");
  constant->parameters()[0].values[2]->d[1] = 1;
  EXPECT_EQ(constant->radiance(Vec3<Dual>{0., 0., 1.}).b.d[1], 1);
  EXPECT_EQ(constant->radiance(Vec3<Dual>{0., 0., 1.}).r.d[1], 0);
}

TEST(Environment, MeanLuminanceIsTheIntegral) {
  for (const MapCase& c : test::map_cases()) {
    const auto map = make_envmap(c.image, 2, test::some_rotation());
    const int rows = std::max(1, c.image.height - 1);
    const auto unturned = make_envmap(c.image, 2);
    double sum = 0;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < 2 * c.image.width; ++x) {
        const auto along_w = [&](double w) {
          const auto along_u = [&](double u) {
            return luminance(unturned->radiance(test::map_direction(u, w)));
          };
          const double size = 0.5 / c.image.width;
          return test::integrate(along_u, x * size, (x + 1) * size, 1) * std::sin(kPi * w);
        };
        sum += test::integrate(along_w, static_cast<double>(y) / rows, (y + 1.0) / rows, 1);
      }
    }
    sum *= 0.5 * kPi;
    EXPECT_NEAR(map->mean_luminance(), sum, 1e-7 * (1 + std::fabs(sum))) << c.name;
  }
  EXPECT_NEAR(make_constant_environment({1, 1, 1})->mean_luminance(), 1, 1e-12);
}

void expect_error(const std::string& message, TestProperties properties) {
  try {
    Scene scene;
    read_light(properties, scene, nullptr);
    FAIL() << "no error: " << message;
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find(message), std::string::npos) << e.what();
  }
}

TEST(Environment, BadInputIsExplained) {
  const TempFiles files;
  const std::string file = files.path("bad.exr");
  Image image(4, 3, 3);
  write_exr(file, image, false, {});
  expect_error(
      "unknown emitter type \"sunsky\" (known: constant, directional, envmap, point, "
      "projector, spot)",
      {"emitter", "sunsky"});
  expect_error("must be finite", {"emitter", "constant", {{"radiance", INFINITY}}});
  Matrix4 sheared;
  sheared.m[0][1] = 0.5;
  expect_error("an envmap can be rotated, not sheared",
               {"emitter", "envmap", {{"filename", file}, {"to_world", sheared}}});
  image.at(2, 1, 1) = std::numeric_limits<float>::quiet_NaN();
  write_exr(file, image, false, {});
  expect_error(file + ": error: the environment map's pixel (column 2, row 1) is not finite",
               {"emitter", "envmap", {{"filename", file}}});
}

// Numbers in their order draw halves of the map in theirs: the second its left and right ones, the
// first the upper and lower ones of an eighth.
TEST(MapDensities, AreDrawnInTheOrderOfNumbers) {
  constexpr int kWidth = 256, kHeight = 129, kNumbers = 1000;
  std::vector<float> importance;
  Rng rng(1, 0, 0);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    importance.push_back(static_cast<float>(rng.uniform()));
  }
  const MapDensity density(kWidth, kHeight, importance);
  bool was_right = false, was_lower = false;
  for (int k = 0; k < kNumbers; ++k) {
    const double ordered = (k + 0.5) / kNumbers;
    const auto across = density.sample(wide::Doubles{} + rng.uniform(), wide::Doubles{} + ordered);
    const bool right = across.x.v[0] >= 0.5 * kWidth;
    EXPECT_GE(right, was_right) << k;
    was_right = right;
    const auto below =
        density.sample(wide::Doubles{} + ordered, wide::Doubles{} + 0.2 * rng.uniform());
    EXPECT_LT(below.x.v[0], 64);
    const bool lower = below.cos_theta.v[0] < 0;
    EXPECT_GE(lower, was_lower) << k;
    was_lower = lower;
  }
  EXPECT_TRUE(was_right);
  EXPECT_TRUE(was_lower);
}

}  // namespace
}  // namespace limn
