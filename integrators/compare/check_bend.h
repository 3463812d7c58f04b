#pragma once
// Images that bend at a parameter's own value, as where shapes that touch part, or where a face is
// edge-on to a light: a derivative there is that of one side, and central differences are the mean
// of both.
#include <optional>

#include "integrators/compare/check_scores.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

// The slope after the parameter's value minus the slope before it, in a weighted sum of windows
// (Score::value, error and z), from one-sided differences over 2 step and step. What grows in
// proportion to the step is taken off: an image that is curved does not bend. weights: one for each
// window. None if the run was interrupted.
std::optional<Score> find_bend(const Scene& scene, const std::string& parameter, double step,
                               const Windows& windows, const std::vector<double>& weights,
                               const RunSettings& settings);

}  // namespace limn
