#pragma once
// A gradient against finite differences.
#include "limn/integrators/differences.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/statistics.h"

namespace limn {

struct CheckOptions {
  std::string parameter;
  std::string method;              // see methods.h; "": the default
  std::vector<std::string> terms;  // by name; none: all that the scene has
  double step = 0;  // of the finite differences; 0 takes the parameter's natural step
  int block = 0;    // pixels; 0 splits the longer side into eight
  std::optional<SampleCounts> samples = SampleCounts{};  // of the gradient
};

// A whole image summed: gradient and differences, each with its standard error.
struct TotalComparison {
  double gradient = 0, gradient_error = 0;
  double difference = 0, difference_error = 0;
  double z = 0;
};

// How much of a term the residual (differences minus gradient) looks like: the residual's
// regression on the term's image.
struct Suspicion {
  double factor =
      0;         // 0 for a right term; 1 if the whole term is missing, -1 if it is counted twice
  double z = 0;  // of the factor
};

struct CheckResult {
  double step = 0;
  int block = 0;
  ZSummary at_step, at_double_step,
      extrapolated;                   // z = (gradient - differences) / combined error, over blocks
  TotalComparison total;              // against the extrapolated differences
  std::vector<Suspicion> suspicions;  // of each term of the gradient, if they disagree
  // The z-scores at the step or the extrapolated ones are plausible at the level 1e-4, and so is
  // the total.
  bool agree = false;
  std::string suspect;  // the term with the largest |z| of these; ""
  GradientResult gradient;
  DifferenceResult differences;
};

// Differences use another seed than the gradient, so that both are independent. Blocks that are
// exactly equal and without variance are left out of the z-scores.
CheckResult check(const Scene& scene, const CheckOptions& options, const RunSettings& settings);

}  // namespace limn
