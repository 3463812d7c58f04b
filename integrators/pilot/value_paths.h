#pragma once
// Paths of a scene in which parameters change values alone: colours, roughness, radiance, texels.
// All else is as in an image, in plain numbers and in lanes.
#include <span>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/moving_colours.h"
#include "integrators/paths/path_context.h"
#include "limn/core/film.h"
#include "limn/core/parameter.h"

namespace limn {

class ValuePaths {
 public:
  // context: of a scene with these parameters seeded, none of which moves anything; not in closed
  // form. Must outlive it.
  ValuePaths(const PathContext& context, std::span<const Parameter> parameters);

  struct Found {
    Rgb<Dual> radiance;
    bool failed;  // it needed a ray that cannot be traced
  };
  // found[i]: by the path of samples[i]; at most kMostTogether. places: where these lie in their
  // pixels; empty: as each pixel's filter has it.
  void trace(std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places,
             RayCount& rays, std::span<Found> found) const;

 private:
  const PathContext& context_;
  MovingColours colours_;
  CameraView<double> camera_;
  FilterTable filter_;
  bool glossy_;
};

}  // namespace limn
