#pragma once
// Images that bend at a parameter's own value, as where shapes that touch part, or where a face is
// edge-on to a light: a derivative there is that of one side, and central differences are the mean
// of both.
#include <optional>

#include "integrators/compare/check_scores.h"
#include "limn/core/blur.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

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

}  // namespace limn
