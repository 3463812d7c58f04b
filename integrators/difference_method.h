#pragma once
// Finite differences as a method to compare with, and how their step is found.
#include "limn/integrators/derivative_method.h"

namespace limn {

inline constexpr const char* kDifferences = "fd";

std::unique_ptr<DerivativeMethod> make_difference_method(const MethodInput& input);

// What a pilot saw of central differences at two steps, as means over pixels and channels.
struct PilotFigures {
  double step = 0;                // the smaller one, h
  double factor = 4;              // the other one is factor * h
  double variance = 0;            // of one sample at h
  double variance_far = 0;        // of one sample at factor * h
  double squared_change = 0;      // of (D_far - D_h)^2, minus its own variance
  double samples_per_second = 0;  // of two images
};
// The step of least expected squared error for a run of that many seconds, between h and
// factor * h: B h^4 + V(h) / n, where B h^4 (factor^2 - 1)^2 = squared_change at the smaller step,
// and V is the power of h that goes through both variances. Without a bias to be seen, the
// geometric middle of the two steps.
double best_step(const PilotFigures& pilot, double seconds);

}  // namespace limn
