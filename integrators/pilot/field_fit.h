#pragma once
// From a pilot's covariances to the directions' motion of every cell, and to what variance is left.
#include <vector>

#include "integrators/pilot/pilot.h"

namespace limn {

struct FieldFit {
  std::vector<DirectionField> fields;  // by cell; empty if directions are better held everywhere
  // [parameter][slot][cell]: the variance of one sample, cross-validated: fields from one half of
  // the pilot are judged by the other. Slots as in PilotFigures::halves.
  std::vector<std::vector<std::vector<double>>> variances;
};

// From a pilot that looked at turns. For every parameter and cell the fit with the least
// cross-validated variance, sums over terms weighed as the best split of the work would for all
// parameters, among windows of 3, 5 and 9 cells; none where that does not halve what holding
// directions has over 9 by 9 cells, for this parameter and for the sum over all of them.
// Deterministic on any number of threads.
FieldFit fit_fields(const PilotFigures& figures, int parameters, int threads);

}  // namespace limn
