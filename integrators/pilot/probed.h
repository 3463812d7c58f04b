#pragma once
// What a pilot found with a plan, where directions may turn as it found best.
#include <vector>

#include "integrators/pilot/field_fit.h"
#include "integrators/pilot/pilot.h"

namespace limn {

struct Probed {
  PilotFigures pilot;
  FieldFit fit;  // empty where turns are not looked at

  // The variance of one sample of every slot, of a parameter: the mean over the film, and in cells
  // where it has them.
  std::vector<double> variances(int lane, std::vector<std::vector<double>>& cells,
                                bool turned = true) const;
  // After equal time, where samples are shared out best among terms: of so many parameters, as a
  // geometric mean; 0 where nothing of one was seen. turned: directions turn as fitted.
  double error_times_work(int parameters, bool turned = true) const;
};

// Arguments: as of run_pilot. The estimator has the plan that is looked at.
Probed probe(const TermEstimator& estimator, bool turns, const PilotSize& size,
             const RunSettings& settings, const Stopwatch& watch);
// The same with the samples from those that it has up to size.spp, of the same pixels; as it was
// where time is short.
void extend(Probed& probed, const TermEstimator& estimator, bool turns, const PilotSize& size,
            const RunSettings& settings, const Stopwatch& watch);

}  // namespace limn
