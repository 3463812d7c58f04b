#pragma once
// Images of a scene.
#include "limn/core/scene.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

struct RenderResult {
  Moments radiance;  // crop_height by crop_width by 3
  int64_t spp = 0;   // samples per pixel that were finished
  uint64_t rays = 0;
  double seconds = 0;
  NonFinite non_finite;
};

RenderResult render(const Scene& scene, const RunSettings& settings);

// One sample done again with all it meets written down, line by line. InputError if the image has
// no such pixel.
std::vector<std::string> trace_sample(const Scene& scene, const RunSettings& settings,
                                      const NonFinite::Place& place);

}  // namespace limn
