// Integrals over polygons of directions: closed forms against quadratures, derivatives against
// differences.
#include "integrators/lights/polygon_light.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/rng.h"
#include "support/meshes.h"

namespace limn {
namespace {

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

// A polygon's integral by quadratures whose fans start from eight points about its middle.
template <class F>
std::vector<Dual> by_quadratures(const std::vector<PolygonSide<Dual>>& sides, double size,
                                 std::span<const Kink> kinks, const F& f) {
  std::vector<Dual> all;
  for (int k = 0; k < 8; ++k) {
    const double angle = 2 * kPi * k / 8;
    const Vec3d pole{0.2 * size * std::cos(angle), 0.2 * size * std::sin(angle), 1};
    all.push_back(polygon_integral<Dual>(sides, normalize(pole), kinks, f).g);
  }
  return all;
}

// What quadratures are off by they differ by: the exact value and its derivative are no farther
// from them than they are from each other, but for rounding. angle: of the polygon.
void expect_among(const Dual& exact, const std::vector<Dual>& quadratures, double angle) {
  const auto expect = [](double x, std::vector<double> found, double rounding) {
    const auto [low, high] = std::minmax_element(found.begin(), found.end());
    const double reach = *high - *low + rounding;
    EXPECT_GE(x, *low - reach);
    EXPECT_LE(x, *high + reach);
  };
  std::vector<double> values, slopes;
  for (const Dual& q : quadratures) {
    values.push_back(q.v);
    slopes.push_back(q.d[0]);
  }
  // Some 500 roundings of terms as large as the angle, and of their derivatives.
  expect(exact.v, values, 0x1p-44 * angle);
  expect(exact.d[0], slopes, 0x1p-44);
}

TEST(PolygonLight, IntegralsAndDerivatives) {
  Rng rng(51, 0, 0);
  for (int trial = 0; trial < 30; ++trial) {
    Vec3d n = random_direction(rng);
    n.z = std::fabs(n.z);  // the polygon must not hold -n
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
    const auto horizon_at = [](double h) { return Dual(0.4 + h, {1, 0, 0, 0}); };
    const auto cosines_at = [&](double h) {
      const auto sides = sides_to(corners_at(h));
      return cosine_integral(std::span<const PolygonSide<Dual>>(sides), normal_at(h));
    };
    const auto ramp_at = [&](double h) {
      const auto sides = sides_to(corners_at(h));
      return ramp_integral(std::span<const PolygonSide<Dual>>(sides), normal_at(h), horizon_at(h));
    };
    // The same by quadrature over the polygon.
    const auto cosines = [&](const Vec3d& w) { return grey(dot(normal_at(0), w)); };
    const auto ramp = [&](const Vec3d& w) {
      const Dual c = dot(normal_at(0), w), h = horizon_at(0), width = h * (1.0 - h);
      const Dual above = c - h;
      return grey(above.v <= 0 ? Dual() : above.v >= width.v ? c : c * above / width);
    };
    const std::array<Kink, 2> kinks = {{{n, 0.4}, {n, 0.64}}};
    const auto sides = sides_to(corners_at(0));
    const double angle = std::min(size, 1.0);
    expect_among(cosines_at(0), by_quadratures(sides, size, {}, cosines), angle);
    expect_among(ramp_at(0), by_quadratures(sides, size, kinks, ramp), angle);
    const auto expect_derivative = [&](const auto& f) {
      const double h = 1e-4 * size;
      const double d1 = (f(h).v - f(-h).v) / (2 * h), d2 = (f(2 * h).v - f(-2 * h).v) / (4 * h);
      EXPECT_NEAR(f(0).d[0], (4 * d1 - d2) / 3, 2e-11 + 1e-9 * size) << size;
    };
    expect_derivative(cosines_at);
    expect_derivative(ramp_at);
  }
}

}  // namespace
}  // namespace limn
