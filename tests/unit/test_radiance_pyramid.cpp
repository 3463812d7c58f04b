// Means over cones against the function itself.
#include <gtest/gtest.h>

#include "limn/core/rng.h"
#include "limn/edgetree/radiance_pyramid.h"

namespace limn {
namespace {

TEST(RadiancePyramid, MeanOverTheSphereIsExact) {
  // 1 + z + z^2 has the mean 1 + 1/3; the midpoint rule on 512^2 points is good to 1e-4.
  const RadiancePyramid pyramid([](const Vec3d& d) { return 1 + d.z + d.z * d.z; }, 7, 4);
  EXPECT_NEAR(pyramid.mean(), 4.0 / 3, 1e-4);
}

TEST(RadiancePyramid, NarrowConesSeeTheFunction) {
  const auto smooth = [](const Vec3d& d) { return 2 + d.x - 0.5 * d.y * d.z; };
  const RadiancePyramid pyramid(smooth, 7, 2);
  Rng rng(1, 2, 3);
  for (int i = 0; i < 1000; ++i) {
    const double z = 2 * rng.uniform() - 1;
    const double phi = 2 * kPi * rng.uniform();
    const double r = std::sqrt(1 - z * z);
    const Vec3d d{r * std::cos(phi), r * std::sin(phi), z};
    // Texels are 2^-6 wide, the gradient at most 1.5.
    EXPECT_NEAR(pyramid.mean(3 * d.x, 3 * d.y, 3 * d.z, 0.001f), smooth(d), 0.03);
  }
}

TEST(RadiancePyramid, SmallBrightLightShowsInEveryConeThatHoldsIt) {
  const Vec3d sun = normalize(Vec3d{0.3, 0.5, -0.8});
  const RadiancePyramid pyramid([&](const Vec3d& d) { return dot(d, sun) > 0.9998 ? 1e4 : 0.1; }, 8,
                                4);
  const double fraction = 0.5 * (1 - 0.9998);
  for (const float tangent : {0.05f, 0.2f, 0.6f}) {
    const double cone = 0.5 * (1 - 1 / std::sqrt(1 + tangent * tangent));
    const double exact = 0.1 + 1e4 * fraction / cone;
    const double mean = pyramid.mean(sun.x, sun.y, sun.z, tangent);
    // Four texels share a light at their common corner, levels are rounded (a factor 2 in solid
    // angle), and texels differ from their mean size by a factor of up to 2.5.
    EXPECT_GT(mean, exact / 20);
    EXPECT_LT(mean, exact * 5);
  }
  EXPECT_LT(pyramid.mean(-sun.x, -sun.y, -sun.z, 0.2f), 0.11f);
}

}  // namespace
}  // namespace limn
