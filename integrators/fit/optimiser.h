#pragma once
// From gradients to steps.
#include <cstdint>
#include <vector>

#include "limn/integrators/fit.h"

namespace limn {

// Of one parameter. Gradients and steps are per natural step, so Adam's steps are of size 1.
class Optimiser {
 public:
  Optimiser(OptimiserKind kind, size_t size);

  // What to add to the numbers, for a step of length 1; `count` of gradients that came before.
  std::vector<double> step(const std::vector<double>& gradient, int64_t count);

  // Running means of gradients and of their squares, not corrected for their start at zero; empty
  // for gradient descent.
  std::vector<double> first, second;

 private:
  OptimiserKind kind_;
};

}  // namespace limn
