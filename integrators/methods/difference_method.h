#pragma once
// How the step of finite differences is found, and what is expected of it.
#include <span>
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/run.h"

namespace limn {

// What a pilot saw of central differences D_h at one step, as means over pixels and channels.
struct StepTrial {
  double step = 0;            // h
  double variance = 0;        // of one sample
  double squared_change = 0;  // of (D_h - D of the next smaller step)^2, minus its own variance
  double change_error = 0;    // standard error of squared_change
};
// Raises the variance at every step to what the larger ones lead to expect: at a small step a short
// pilot meets no edge and sees no variance, which grows as 1 / h. trials: by ascending step.
void extrapolate_variances(std::span<StepTrial> trials);

// The squared error that differences at a step are expected to have in a run.
struct StepForecast {
  double step = 0;
  double squared_bias = 0, variance = 0;
  double most_squared_bias = 0;  // as far as the trials tell
  double squared_error() const { return squared_bias + variance; }
};

// The step of least expected squared error with that many samples. trials: by ascending step, each
// the same factor times the one before; the squared change of the first is not used. The bias
// grows with h^2, which gives the squared bias of a step from its change, and that of the first
// from the second's; around the best trial the variance is taken for a power of h. A change is
// taken for its error more than was found: a short pilot cannot tell it from none. The squared bias
// falls as squared changes do that it can tell, between h and h^2.
StepForecast best_step(std::span<const StepTrial> trials, double samples);

// The samples per pixel of a run that takes `per_second` and has `left` seconds behind its pilot,
// below 0 if the pilot took them all: at least `least`, which a run takes whatever they cost.
double samples_behind_pilot(double per_second, double left, int least);

// Images that a pilot makes at a time, each with a ray tracer of its own.
inline constexpr int kPilotImages = 10;

// The steps of a run.
struct DifferencePlan {
  struct Step {
    StepForecast forecast;  // all 0 but the step where no pilot has looked
    std::string found_by;
    double samples = 0;  // per pixel, for which it is
  };
  std::vector<Step> steps;  // of each parameter
  double seconds = 0;       // of pilots
};
// rays: for a run of so many over all pixels; 0: of settings.spp or settings.seconds.
DifferencePlan plan_differences(const Scene& scene, const GradientOptions& options,
                                const RunSettings& settings, double rays = 0);
// watch: runs since the plan was begun.
GradientResult run_planned(const std::string& term, const Scene& scene,
                           const GradientOptions& options, const RunSettings& settings,
                           const DifferencePlan& plan, const Stopwatch& watch);

}  // namespace limn
