#pragma once
// Numerical integration for reference values.
#include <cmath>

namespace limn::test {

// Gauss-Legendre nodes and weights on [-1, 1], found by Newton's method.
template <int kPoints>
struct GaussLegendre {
  double nodes[kPoints], weights[kPoints];

  GaussLegendre() {
    for (int i = 0; i < kPoints; ++i) {
      double x = std::cos(3.14159265358979323846 * (i + 0.75) / (kPoints + 0.5));
      double slope = 0;
      for (int step = 0; step < 20; ++step) {
        double p = 1, before = 0;
        for (int n = 1; n <= kPoints; ++n) {
          const double next = ((2 * n - 1) * x * p - (n - 1) * before) / n;
          before = p;
          p = next;
        }
        slope = kPoints * (x * p - before) / (x * x - 1);
        x -= p / slope;
      }
      nodes[i] = x;
      weights[i] = 2 / ((1 - x * x) * slope * slope);
    }
  }
};

// Integral of f from a to b, with `panels` panels of eight points.
template <class F>
double integrate(F f, double a, double b, int panels) {
  static const GaussLegendre<8> rule;
  const double half = 0.5 * (b - a) / panels;
  double sum = 0;
  for (int p = 0; p < panels; ++p) {
    const double middle = a + half * (2 * p + 1);
    for (int i = 0; i < 8; ++i) sum += rule.weights[i] * f(middle + half * rule.nodes[i]);
  }
  return sum * half;
}

}  // namespace limn::test
