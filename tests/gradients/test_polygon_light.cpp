// Integrals over polygons of directions against quadrature, derivatives against differences.
#include "integrators/lights/polygon_light.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/rng.h"
#include "support/meshes.h"
#include "support/quadrature.h"

namespace limn {
namespace {

using test::integrate;

// Directions to the corners of a polygon, some of them moving in the first lane.
std::vector<PolygonSide<Dual>> sides_to(const std::vector<Vec3<Dual>>& corners) {
  std::vector<PolygonSide<Dual>> sides;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3<Dual>& next = corners[(i + 1) % corners.size()];
    sides.push_back(
        {cross(corners[i], next), normalize(value(corners[i])), normalize(value(next))});
  }
  return sides;
}

// The integral of n . w, over triangles from a pole amid the polygon.
double by_quadrature(const std::vector<PolygonSide<Dual>>& sides, const Vec3d& n) {
  const Vec3d pole{0, 0, 1};
  double sum = 0;
  for (const PolygonSide<Dual>& side : sides) {
    const auto row = [&](double s) {
      const auto at = [&](double t) {
        const Vec3d end = side.begin + (side.end - side.begin) * t, w = pole + (end - pole) * s;
        const double square = dot(w, w);
        return s * dot(n, w) / (square * square);
      };
      return integrate(at, 0, 1, 8);
    };
    sum += determinant(pole, side.begin, side.end) * integrate(row, 0, 1, 8);
  }
  return sum;
}

TEST(PolygonLight, IntegralsAndDerivatives) {
  Rng rng(51, 0, 0);
  for (int trial = 0; trial < 30; ++trial) {
    const Vec3d n = random_direction(rng);
    const Vec3d turn = random_direction(rng);
    std::vector<Vec3d> at, velocity;
    const double size = trial % 3 == 0 ? 3 : trial % 3 == 1 ? 0.5 : 1e-3;
    for (int k = 0; k < 5; ++k) {
      const double angle = 2 * kPi * (k + 0.5 * rng.uniform()) / 5;
      at.push_back({size * std::cos(angle), size * std::sin(angle), 1 + 0.3 * rng.uniform()});
      velocity.push_back(random_direction(rng));
    }
    const auto corners_at = [&](double h) {
      std::vector<Vec3<Dual>> corners;
      for (int k = 0; k < 5; ++k) {
        const Vec3d x = at[k] + velocity[k] * h;
        corners.push_back({{x.x, {velocity[k].x, 0, 0, 0}},
                           {x.y, {velocity[k].y, 0, 0, 0}},
                           {x.z, {velocity[k].z, 0, 0, 0}}});
      }
      return corners;
    };
    const auto normal_at = [&](double h) {
      const Vec3<Dual> angle{{h * turn.x, {turn.x, 0, 0, 0}},
                             {h * turn.y, {turn.y, 0, 0, 0}},
                             {h * turn.z, {turn.z, 0, 0, 0}}};
      return normalize(cross(angle, n) + n);
    };
    const auto cosines_at = [&](double h) {
      const auto sides = sides_to(corners_at(h));
      return cosine_integral(std::span<const PolygonSide<Dual>>(sides), normal_at(h));
    };
    // Some 500 roundings of terms as large as the polygon's angle.
    const double rounding = 0x1p-44 * std::min(size, 1.0);
    EXPECT_NEAR(cosines_at(0).v, by_quadrature(sides_to(corners_at(0)), n), rounding);
    const auto difference = [&](double h) {
      return (cosines_at(h).v - cosines_at(-h).v) / (2 * h);
    };
    const double h = 1e-4 * size;
    const double expected = (4 * difference(h) - difference(2 * h)) / 3;
    EXPECT_NEAR(cosines_at(0).d[0], expected, 2e-11 + 1e-9 * size) << size;
  }
}

}  // namespace
}  // namespace limn
