// The weight that lights give to boxes.
#include <gtest/gtest.h>

#include <cmath>

#include "edgetree/light/light_term.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

Vec3d random_direction(Rng& rng) {
  const double z = 2 * rng.uniform() - 1, phi = 2 * kPi * rng.uniform();
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

// A square at `center` with half side `half`, shining along `normal`.
void add_square(std::vector<LightTriangle>& lights, const Vec3d& center, const Vec3d& normal,
                double half, double luminance) {
  const Frame frame(normal);
  const Vec3d s = frame.s * half, t = frame.t * half;
  const Vec3d corners[4] = {center - s - t, center + s - t, center + s + t, center - s + t};
  lights.push_back({{corners[0], corners[1], corners[2]}, luminance});
  lights.push_back({{corners[0], corners[2], corners[3]}, luminance});
}

// One box in the first lane.
double weight(const LightCones& cones, const Vec3d& center, const Vec3d& half) {
  const auto lane = [](double a) { return splat(static_cast<float>(a)); };
  return cones.mean_over_boxes({lane(center.x), lane(center.y), lane(center.z)},
                               {lane(half.x), lane(half.y), lane(half.z)})[0];
}

TEST(LightTerm, OnlyEnvironmentHasNoCones) {
  EXPECT_TRUE(LightClusters({}, 2).empty());
  std::vector<LightTriangle> lights;
  add_square(lights, {0, 0, 1}, {0, 0, -1}, 1, 0);  // black
  EXPECT_TRUE(LightClusters(lights, 2).empty());
  add_square(lights, {0, 0, 1}, {0, 0, -1}, 1, 3);
  EXPECT_FALSE(LightClusters(lights, 2).empty());
}

// A small box in front of a light sees it whole; one elsewhere, or any box where the light faces
// away, has the least weight; a wide one lies between.
TEST(LightTerm, DirectionsOfTheLightWeighMore) {
  std::vector<LightTriangle> lights;
  add_square(lights, {0, 0, 10}, {0, 0, -1}, 2, 5);
  const LightClusters clusters(lights, 0.25);
  const LightCones cones(clusters, {0, 0, 0});
  const double elsewhere = weight(cones, {3, 0, 0}, {0.1, 0.1, 0.1});
  // Objects scatter half of what arrives over pi. The square's corners are sqrt(108) away, its
  // middle 10, so its solid angle is between 16 / 108^(3/2) * 10 and 16 / 100.
  EXPECT_GT(elsewhere, 0.25 + 5 * 0.5 / kPi * 160 / std::pow(108, 1.5));
  EXPECT_LT(elsewhere, 0.25 + 5 * 0.5 / kPi * 0.16);
  EXPECT_FLOAT_EQ(weight(cones, {0, 0, 3}, {0.01, 0.01, 0.01}), 5 + elsewhere);
  EXPECT_EQ(weight(cones, {0, 0, -3}, {0.01, 0.01, 0.01}), elsewhere);
  const double wide = weight(cones, {0, 0, 3}, {2, 2, 2});
  EXPECT_GT(wide, elsewhere);
  EXPECT_LT(wide, 5 + elsewhere);

  const LightCones behind(clusters, {0, 0, 20});
  const double dark = weight(behind, {0, 0, -3}, {0.01, 0.01, 0.01});
  EXPECT_EQ(dark, weight(behind, {3, 0, 0}, {0.1, 0.1, 0.1}));
  EXPECT_GE(dark, 0.25);
}

// Any number of lights, any box, any scale: finite, positive, bounded by what shines.
TEST(LightTerm, IsPositiveAndBounded) {
  Rng rng(1, 0, 0);
  for (int i = 0; i < 300; ++i) {
    const double scale = std::exp(std::log(1e4) * (2 * rng.uniform() - 1));
    const double environment = i % 2 ? rng.uniform() : 0;
    std::vector<LightTriangle> lights;
    const int count = 1 + static_cast<int>(20 * rng.uniform());
    for (int k = 0; k < count; ++k)
      add_square(lights, random_direction(rng) * scale, random_direction(rng),
                 scale * rng.uniform(), 1 + rng.uniform());
    const LightClusters clusters(lights, environment);
    for (int k = 0; k < 20; ++k) {
      // Among others exactly at a light's corner, and boxes around p.
      const Vec3d p =
          k == 0 ? lights[0].corners[0] : random_direction(rng) * (2 * scale * rng.uniform());
      const LightCones cones(clusters, p);
      const double size = scale * std::exp(-9 * rng.uniform());
      const Vec3d half = Vec3d{rng.uniform(), rng.uniform(), k == 1 ? 0 : rng.uniform()} * size;
      const double w = weight(cones, k == 2 ? Vec3d{} : random_direction(rng) * scale, half);
      EXPECT_GT(w, environment);
      EXPECT_LE(w, environment + 2 * LightClusters::kMaxClusters * 2);
    }
  }
}

// Splitting a light's triangles does not change what it is worth.
TEST(LightTerm, DoesNotDependOnTheTessellation) {
  std::vector<LightTriangle> coarse, fine;
  add_square(coarse, {0, 0, 10}, {0, 0, -1}, 1, 5);
  for (int x = 0; x < 8; ++x)
    for (int y = 0; y < 8; ++y)
      add_square(fine, {(x - 3.5) / 4, (y - 3.5) / 4, 10}, {0, 0, -1}, 0.125, 5);
  const LightClusters a(coarse, 0), b(fine, 0);
  Rng rng(2, 0, 0);
  for (int i = 0; i < 100; ++i) {
    const Vec3d p = random_direction(rng) * 5.0, center = random_direction(rng) * 3.0;
    const Vec3d half = Vec3d{1, 1, 1} * rng.uniform();
    const double expected = weight(LightCones(a, p), center, half);
    EXPECT_NEAR(weight(LightCones(b, p), center, half), expected, 1e-5 * expected);
  }
}

}  // namespace
}  // namespace limn
