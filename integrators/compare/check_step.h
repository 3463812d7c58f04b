#pragma once
// The step at which a gradient is checked against differences.
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

}  // namespace limn
