// Environment sampling against the density that it reports.
#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/mis_compensation.h"
#include "limn/core/rng.h"
#include "src/bsdf/cosine.h"
#include "support/chi_square.h"
#include "support/environment_maps.h"
#include "support/quadrature.h"
#include "support/scenes.h"

namespace limn {
namespace {

using test::MapCase;

constexpr int kSamples = 100000;

// Bins over the unit square (u, w): each cell between texels is cut in two by two. Texel columns
// lie at half integers, so that cells begin at u = 1 / (2 W).
struct Bins {
  int columns, rows;
  double shift;

  explicit Bins(const Image& image)
      : columns(2 * image.width),
        rows(2 * std::max(1, image.height - 1)),
        shift(0.5 / image.width) {}

  size_t bin(const Vec3d& v) const {
    double u = std::atan2(v.x, -v.z) / (2 * kPi) - shift;
    u -= std::floor(u);
    const double w = std::atan2(std::hypot(v.x, v.z), v.y) / kPi;
    const int x = std::min(columns - 1, static_cast<int>(u * columns));
    const int y = std::min(rows - 1, static_cast<int>(w * rows));
    return static_cast<size_t>(y) * columns + x;
  }
  // Integral over solid angle of f, smooth within a bin, for each bin.
  template <class F>
  std::vector<double> integrate(F f) const {
    std::vector<double> result;
    for (int y = 0; y < rows; ++y) {
      for (int x = 0; x < columns; ++x) {
        const auto along_w = [&](double w) {
          const auto along_u = [&](double u) { return f(test::map_direction(u, w)); };
          return test::integrate(along_u, shift + static_cast<double>(x) / columns,
                                 shift + (x + 1.0) / columns, 1) *
                 std::sin(kPi * w) * 2 * kPi * kPi;
        };
        result.push_back(
            test::integrate(along_w, static_cast<double>(y) / rows, (y + 1.0) / rows, 1));
      }
    }
    return result;
  }
};

Vec3d apply(const Matrix4& m, const Vec3d& v) {
  return {m.m[0][0] * v.x + m.m[0][1] * v.y + m.m[0][2] * v.z,
          m.m[1][0] * v.x + m.m[1][1] * v.y + m.m[1][2] * v.z,
          m.m[2][0] * v.x + m.m[2][1] * v.y + m.m[2][2] * v.z};
}
Vec3d apply_transposed(const Matrix4& m, const Vec3d& v) {
  Matrix4 t;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) t.m[i][j] = m.m[j][i];
  }
  return apply(t, v);
}

// What a draw says of itself is what the map says of its direction, in the two scalars alike.
void expect_same_look(const Environment& map, const Environment::Drawn& drawn) {
  const Vec3d& d = drawn.direction;
  Environment::Sight<double> sight;
  Environment::Sight<Dual> dual;
  const auto place = map.find(d);
  map.look(d, place, sight);
  map.look(d, place, dual);
  LightSample sample{d};
  sample.place = drawn.place;
  EXPECT_NEAR(drawn.pdf, map.pdf_solid_angle(d), 1e-8 * drawn.pdf);
  EXPECT_EQ(sight.pdf, map.pdf_solid_angle(d));
  EXPECT_EQ(dual.pdf, sight.pdf);
  const double scale = 1 + std::fabs(map.radiance(d).r);
  EXPECT_NEAR(map.drawn_radiance<double>(sample).r, map.radiance(d).r, 1e-6 * scale);
  EXPECT_EQ(map.drawn_radiance<Dual>(sample).r.v, map.drawn_radiance<double>(sample).r);
  EXPECT_EQ(sight.radiance.r, map.radiance(d).r);
  EXPECT_EQ(dual.radiance.r.v, sight.radiance.r);
}

// In debug builds; without a place of its own a walk would see one texel everywhere.
TEST(EnvironmentSamplingDeathTest, AMapIsLookedAtWhereItsDirectionLies) {
  const TempFiles files;
  SceneParts parts;
  parts.body = make_sky(files, "sky");
  const Scene scene = make_scene(files, parts);
  Environment::Sight<double> sight;
  EXPECT_DEBUG_DEATH(scene.environment->look(normalize(Vec3d{1, 2, 3}), {}, sight), "find");
}

// The map, and with draws of its peaks.
std::vector<std::shared_ptr<Environment>> both_draws(const std::shared_ptr<Environment>& map) {
  return {map, mis_compensated(map)};
}

void expect_drawn_by_density(const MapCase& c, const Environment& map, const Matrix4& turn,
                             double threshold) {
  const Bins bins(c.image);
  std::vector<double> expected =
      bins.integrate([&](const Vec3d& v) { return map.pdf_solid_angle(apply(turn, v)); });
  double sum = 0;
  for (double& e : expected) {
    sum += e;
    e *= kSamples;
  }
  EXPECT_NEAR(sum, 1, 1e-8) << c.name;
  std::vector<double> observed(expected.size(), 0);
  Rng rng(1, 2, 3);
  std::array<Environment::Numbers, 10> u;
  std::array<Environment::Drawn, 10> drawn;
  static_assert(kSamples % 10 == 0);
  for (int i = 0; i < kSamples; i += 10) {
    for (auto& pair : u) pair = {rng.uniform(), rng.uniform()};
    map.sample_directions(u, drawn);
    for (const auto& one : drawn) {
      EXPECT_NEAR(length(one.direction), 1, 1e-14);
      if (i < 1000) expect_same_look(map, one);
      ++observed[bins.bin(apply_transposed(turn, one.direction))];
    }
  }
  const test::ChiSquare result = test::chi_square_test(observed, expected);
  EXPECT_GT(result.p_value, threshold) << c.name << ": chi-square " << result.statistic << " with "
                                       << result.degrees_of_freedom << " degrees of freedom";
}

TEST(EnvironmentSampling, MatchesItsDensity) {
  const Matrix4 turn = test::some_rotation();
  const std::vector<MapCase> cases = test::map_cases();
  const double threshold = test::sidak_threshold(0.01, 2 * static_cast<int>(cases.size()));
  for (const MapCase& c : cases) {
    for (const auto& map : both_draws(test::make_envmap(c.image, 3, turn))) {
      expect_drawn_by_density(c, *map, turn, threshold);
    }
  }
}

// To the bit, however many are drawn at once, and wherever among them.
TEST(EnvironmentSampling, DirectionsDoNotDependOnThoseBesideThem) {
  std::vector<std::shared_ptr<const Environment>> skies;
  for (const MapCase& c : test::map_cases()) {
    skies.push_back(test::make_envmap(c.image, 3, test::some_rotation()));
  }
  const TempFiles files;
  SceneParts parts;
  parts.body = R"(<emitter type="constant"/>)";
  skies.push_back(make_scene(files, parts).environment);
  for (const auto& sky : skies) {
    Rng rng(7, 8, 9);
    std::vector<Environment::Numbers> u(17);
    for (auto& pair : u) pair = {rng.uniform(), rng.uniform()};
    u[3] = {0, 0}, u[11] = {std::nextafter(1, 0), std::nextafter(1, 0)};
    for (size_t count = 0; count <= u.size(); ++count) {
      std::vector<Environment::Drawn> drawn(count);
      sky->sample_directions(std::span(u).last(count), drawn);
      for (size_t i = 0; i < count; ++i) {
        const auto& [u1, u2] = u[u.size() - count + i];
        const Environment::Drawn alone = sky->sample_direction(u1, u2);
        for (int k = 0; k < 3; ++k) EXPECT_EQ(drawn[i].direction[k], alone.direction[k]);
        EXPECT_EQ(drawn[i].pdf, alone.pdf);
        EXPECT_EQ(drawn[i].place, alone.place);
      }
    }
  }
}

// Sampling the map estimates its integral, and never misses radiance: the second moment is finite
// and small, even where a cell is black on one side.
TEST(EnvironmentSampling, EstimatesTheMean) {
  for (const MapCase& c : test::map_cases()) {
    const auto map = test::make_envmap(c.image, 3, test::some_rotation());
    double sum = 0, sum2 = 0;
    Rng rng(4, 5, 6);
    for (int i = 0; i < kSamples; ++i) {
      const double u1 = rng.uniform();
      const double u2 = rng.uniform();
      const Vec3d d = map->sample_direction(u1, u2).direction;
      const double value = luminance(map->radiance(d)) / (map->pdf_solid_angle(d) * 4 * kPi);
      sum += value;
      sum2 += value * value;
    }
    const double mean = sum / kSamples;
    const double deviation = std::sqrt(std::max(0.0, sum2 / kSamples - mean * mean));
    EXPECT_NEAR(mean, map->mean_luminance(), 4.5 * deviation / std::sqrt(kSamples) + 1e-6 * mean)
        << c.name;
    if (c.name.find("negative") == std::string::npos) {
      EXPECT_LE(deviation, map->mean_luminance()) << c.name;
    }
  }
}

TEST(EnvironmentSampling, DensityIsPositiveWhereRadianceIsNot0) {
  Rng rng(7, 8, 9);
  for (const MapCase& c : test::map_cases()) {
    for (const auto& map : both_draws(test::make_envmap(c.image))) {
      for (int i = 0; i < 20000; ++i) {
        const double u1 = rng.uniform();
        const double u2 = rng.uniform();
        const Vec3d d = test::map_direction(u1, u2);
        EXPECT_TRUE(is_black(map->radiance(d)) || map->pdf_solid_angle(d) > 0) << c.name;
      }
    }
  }
}

// The mean of what a diffuse surface scatters, and the mean square, of one draw from the map and
// one from the cosine, combined as paths do.
std::array<double, 2> scattered_moments(const Environment& map, const Vec3d& n) {
  std::array<double, 2> moments{};
  Rng rng(10, 11, 12);
  for (int i = 0; i < kSamples; ++i) {
    double sum = 0;
    for (const bool of_map : {true, false}) {
      const double u1 = rng.uniform(), u2 = rng.uniform();
      const Vec3d d = of_map ? map.sample_direction(u1, u2).direction : sample_cosine(n, u1, u2);
      const double cosine = std::max(0.0, dot(n, d)) / kPi, density = map.pdf_solid_angle(d);
      const double own = of_map ? density : cosine, other = of_map ? cosine : density;
      sum += luminance(map.radiance(d)) * cosine * own / (own * own + other * other);
    }
    moments[0] += sum / kSamples;
    moments[1] += sum * sum / kSamples;
  }
  return moments;
}

TEST(EnvironmentSampling, PeaksLeaveDimLightToScattering) {
  Image image(64, 33, 3);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool window = x > 20 && x < 28 && y > 8 && y < 14;
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = window ? 20 : 1 + 0.5f * (x / 8 % 2);
    }
  }
  const auto map = test::make_envmap(image);
  const Vec3d n = normalize(Vec3d{1, 2, 0.5});
  const auto plain = scattered_moments(*map, n);
  const auto peaks = scattered_moments(*mis_compensated(map), n);
  const double variance = plain[1] - plain[0] * plain[0];
  const double left = peaks[1] - peaks[0] * peaks[0];
  EXPECT_NEAR(peaks[0], plain[0], 4.5 * std::sqrt((variance + left) / kSamples));
  EXPECT_LT(left, 0.75 * variance);
}

TEST(EnvironmentSampling, ConstantIsUniform) {
  const auto constant = make_constant_environment({1, 1, 1});
  const Bins bins(Image(4, 5, 1));
  std::vector<double> expected =
      bins.integrate([&](const Vec3d& d) { return kSamples * constant->pdf_solid_angle(d); });
  std::vector<double> observed(expected.size(), 0);
  Rng rng(1, 1, 1);
  for (int i = 0; i < kSamples; ++i) {
    const double u1 = rng.uniform();
    const double u2 = rng.uniform();
    ++observed[bins.bin(constant->sample_direction(u1, u2).direction)];
  }
  EXPECT_GT(test::chi_square_test(observed, expected).p_value, 0.01);
}

}  // namespace
}  // namespace limn
