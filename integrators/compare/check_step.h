#pragma once
// The step and the samples with which a gradient is checked, and slopes on both sides of a value.
#include <cstdint>
#include <optional>

#include "integrators/compare/check_scores.h"
#include "limn/core/blur.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

// The largest step, up to `most` and the parameter's natural one (some of these for what moves
// shapes, camera or delta lights), whose differences are biased by less than a
// part of the standard error that their extrapolation will have with settings.spp samples: as a
// mean over the windows, and of the whole image. From a pilot with a seed of its own. A power of
// two: moved positions are exact where floats allow it. blur: see central_differences().
double find_check_step(const Scene& scene, const std::string& parameter, const Windows& windows,
                       double most, const RunSettings& settings, const std::optional<Blur>& blur);

// The same judged by the run itself, which sees more than the pilot: the step if the run's bias is
// small enough, else a smaller one.
double reduced_step(const DifferenceResult& differences, double step, const Windows& windows);

// A copy of the scene in which the texels that a parameter moves keep to their range over twice a
// step; none if they do so in the scene. Beyond its range, a texel of an opacity changes nothing.
std::optional<Scene> with_texels_inside(const Scene& scene, const Parameter& parameter,
                                        double step);

struct Bend {
  Score sum;  // of a weighted sum of windows
  // The sum of the bends of single windows without their signs: what parts in several places may
  // bend one up and another down. Noise adds nothing to it in the mean (but may make it negative).
  double most = 0, most_error = 0;
};

// The slope after the parameter's value minus the slope before it, from one-sided differences over
// 2 step and step. What grows in proportion to the step is taken off: an image that is curved does
// not bend. weights: one for each window. blur: see central_differences(). None if the run was
// interrupted.
std::optional<Bend> find_bend(const Scene& scene, const std::string& parameter, double step,
                              const Windows& windows, const std::vector<double>& weights,
                              const RunSettings& settings,
                              const std::optional<Blur>& blur = std::nullopt);

// Samples per pixel.
struct CheckSamples {
  int64_t gradient = 0, differences = 0;
};

// What a run cost and what its mean's variance was.
struct CheckCost {
  int64_t samples = 0;
  double seconds = 0;
  double variance = 0;
};

// The first run's: enough for variances.
inline constexpr int64_t kFirstCheckSamples = 16;
// At most: a second run takes twice as many, in an int.
inline constexpr int64_t kMostCheckSamples = 1 << 29;

// The samples of least time with which the error of the difference becomes `factor` times as large,
// or the smallest error that takes `seconds` at most. Nothing where that is no longer run. Neither
// takes less than an eighth of the time: a few samples may not hold the events that rule their
// variance.
std::optional<CheckSamples> more_samples(const CheckCost& gradient, const CheckCost& differences,
                                         double factor, double seconds);

}  // namespace limn
