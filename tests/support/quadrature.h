#pragma once
// Numerical integration for reference values.

namespace limn::test {

// Integral of f from a to b, with `panels` panels of eight points: Gauss and Legendre's, from a
// table (Abramowitz and Stegun 1964, Table 25.4), so that it shares nothing with the program's own.
template <class F>
double integrate(F f, double a, double b, int panels) {
  constexpr double kNodes[] = {0.183434642495650, 0.525532409916329, 0.796666477413627,
                               0.960289856497536};
  constexpr double kWeights[] = {0.362683783378362, 0.313706645877887, 0.222381034453374,
                                 0.101228536290376};
  const double half = 0.5 * (b - a) / panels;
  double sum = 0;
  for (int p = 0; p < panels; ++p) {
    const double middle = a + half * (2 * p + 1);
    for (int i = 0; i < 4; ++i) {
      sum += kWeights[i] * (f(middle - half * kNodes[i]) + f(middle + half * kNodes[i]));
    }
  }
  return sum * half;
}

}  // namespace limn::test
