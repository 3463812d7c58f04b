#pragma once
// How positions on the film move: chosen for every cell by a pilot of its own, which comes before
// the other one. With positions that move by V (terms/filter.cpp) a derivative changes by V times
// an amount D whose mean is zero: what all other terms add where the film moves under the scene,
// edges at rest included, less what the pixels lose and gain at their rims. So V is a control
// variate's coefficient, any one is right, and one that follows what a pixel sees takes out most of
// what slides and is covered there, of shadows and mirror images as well.
#include <vector>

#include "integrators/estimates/batches.h"
#include "integrators/pilot/sample_plan.h"
#include "integrators/pilot/term_estimator.h"

namespace limn {

struct FilmFit {
  int spp = 0;                     // samples of every probed pixel; 0: there was no time
  PlanGrid grid;                   // that of run_pilot
  std::vector<FilmMotion> motion;  // by cell; empty if positions are better held everywhere
};

// So many parameters can be probed at once: the film takes two lanes.
inline constexpr int kMostFilmParameters = kLanes - 2;

// How fast, about, what moves does so on the film [pixels per unit of the first parameter].
double film_speed(const TermEstimator& estimator);

// plan: what samples hold meanwhile. The estimator has it, with other motions, afterwards. spp, settings, watch: as of
// run_pilot. Deterministic on any number of threads.
FilmFit fit_film(TermEstimator& estimator, SamplePlan plan, int spp, const RunSettings& settings,
                 const Stopwatch& watch);

}  // namespace limn
