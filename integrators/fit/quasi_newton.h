#pragma once
// Minimising a function whose values and derivatives are exact: limited-memory BFGS, and a line
// search to Wolfe's conditions. After Nocedal and Wright 2006, "Numerical Optimization",
// algorithms 7.4, 3.5 and 3.6.
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "limn/integrators/fit.h"

namespace limn {

// A sum of products; of vectors of one size.
double inner_product(const std::vector<double>& a, const std::vector<double>& b);

class QuasiNewton {
 public:
  static constexpr size_t kMemory = 10;  // pairs; not tuned

  // Along which the function falls: minus the gradient times an estimate of the inverse Hessian;
  // without any pair minus the gradient itself.
  std::vector<double> direction(const std::vector<double>& gradient) const;
  // A step that was taken and by how much the gradient changed. Left out where the function is not
  // convex along the step.
  void add(std::vector<double> step, std::vector<double> change);
  // As if the numbers that are marked had never been moved.
  QuasiNewton without(const std::vector<bool>& held) const;
  bool empty() const { return steps.empty(); }
  void clear();

  std::vector<std::vector<double>> steps, changes;  // the oldest first
};

// A function along a line: its value, and its derivative by the place on the line.
struct LinePoint {
  double at = 0, value = 0, slope = 0;
  // What bounds kept back, of the change (at - start.at) start.slope that the start foretells.
  double held = 0;
};

// A place where the value is at most start.value + 1e-4 (at start.slope - held), and the slope at
// most 0.9 of that of the start in magnitude, or if there is none, one where the value is lower.
// evaluate: at a place; a value that is not finite says that nothing is there; none: stop. first:
// the first place to look at. start.slope must be negative. None if none was found in 20
// evaluations.
std::optional<LinePoint> wolfe_search(
    const std::function<std::optional<LinePoint>(double)>& evaluate, const LinePoint& start,
    double first);

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
