// Every function of a dual number against central differences.
#include <gtest/gtest.h>

#include "limn/core/dual.h"

namespace limn {
namespace {

template <class F>
void expect_derivative(F f, double x) {
  const double h = 1e-6;
  const Dual y = f(Dual(x, Lanes{1, 0, -2, 0}));
  const double expected = (f(Dual(x + h)).v - f(Dual(x - h)).v) / (2 * h);
  EXPECT_DOUBLE_EQ(y.v, f(Dual(x)).v);
  EXPECT_NEAR(y.d[0], expected, 1e-8 * (1 + std::fabs(expected)));
  EXPECT_EQ(y.d[1], 0);
  EXPECT_DOUBLE_EQ(y.d[2], -2 * y.d[0]);
}

TEST(Dual, FunctionsMatchDifferences) {
  for (double x : {0.1, 0.37, 0.9}) {
    expect_derivative([](Dual a) { return a * a + 3.0 * a - a / 2.0 + 1.0 - 2.0; }, x);
    expect_derivative([](Dual a) { return a / (1.0 + a) + 2.0 / a + (a - 3.0) * (5.0 - a); }, x);
    expect_derivative([](Dual a) { return sqrt(a) + exp(a) + sin(a) * cos(a) + tan(a); }, x);
    expect_derivative([](Dual a) { return acos(a) + atan2(a, 0.3 - a) + atan2(Dual(0.2), a); }, x);
    expect_derivative([](Dual a) { return max(a, Dual(0.5)) * min(a * a, Dual(0.3)); }, x);
  }
}

TEST(Dual, VectorsMixWithConstants) {
  const Vec3<Dual> a{Dual(1, Lanes{1, 0, 0, 0}), 2.0, 3.0};
  const Vec3d b{0.5, -1, 2};
  EXPECT_DOUBLE_EQ(dot(a, b).d[0], 0.5);
  EXPECT_DOUBLE_EQ(cross(a, b).y.d[0], -2);
  EXPECT_DOUBLE_EQ(length(a).d[0], 1 / std::sqrt(14.0));
}

}  // namespace
}  // namespace limn
