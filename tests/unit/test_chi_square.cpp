// The tests' own statistics.
#include "support/chi_square.h"

#include <gtest/gtest.h>

#include <cmath>

#include "support/quadrature.h"

namespace limn::test {
namespace {

// Q(1, x) = exp(-x), Q(1/2, x) = erfc(sqrt x), and Q(a + 1, x) = Q(a, x) + x^a exp(-x) /
// Gamma(a + 1).
TEST(ChiSquare, GammaFunctionMatchesClosedForms) {
  for (double x : {1e-3, 0.5, 1.4, 1.6, 7.0, 40.0}) {
    EXPECT_NEAR(upper_gamma(1, x), std::exp(-x), 1e-13);
    EXPECT_NEAR(upper_gamma(0.5, x), std::erfc(std::sqrt(x)), 1e-13);
    for (double a : {0.5, 3.0, 17.5, 100.0}) {
      const double step = std::exp(a * std::log(x) - x - std::lgamma(a + 1));
      EXPECT_NEAR(upper_gamma(a + 1, x), upper_gamma(a, x) + step, 1e-12);
    }
  }
}

TEST(ChiSquare, RejectsWhatIsWrong) {
  EXPECT_GT(chi_square_test({1010, 990, 1000}, {1000, 1000, 1000}).p_value, 0.5);
  EXPECT_LT(chi_square_test({1200, 800, 1000}, {1000, 1000, 1000}).p_value, 1e-6);
  EXPECT_EQ(chi_square_test({1000, 1}, {1001, 0}).p_value, 0);
  EXPECT_LT(chi_square_test({900, 100}, {999.9, 0.1}).p_value, 1e-6);
}

TEST(ChiSquare, SidakKeepsTheFamilyRate) {
  EXPECT_NEAR(1 - std::pow(1 - sidak_threshold(0.01, 50), 50), 0.01, 1e-12);
}

TEST(Quadrature, IsExactForPolynomials) {
  EXPECT_NEAR(integrate([](double x) { return std::pow(x, 15); }, 0, 2, 1), 4096, 1e-9);
  EXPECT_NEAR(integrate([](double x) { return std::sin(x); }, 0, 3.0, 3), 1 - std::cos(3.0), 1e-13);
}

}  // namespace
}  // namespace limn::test
