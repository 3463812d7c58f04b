#pragma once
// Images of a scene.
#include <span>
#include <string>
#include <vector>

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

// The ways to an image.
struct RenderMethod {
  const char* name;
  const char* description;
  bool closed_light;  // light that is scattered once, in closed form (analytic)
};
// The first is the default.
std::span<const RenderMethod> render_methods();

// Where the random numbers of a pixel's samples come from, by Mitsuba's and pbrt's names.
inline constexpr const char* kRenderSamplers[] = {"padded-sobol", "independent"};

struct RenderOptions {
  std::string method = "path";  // InputError for others than render_methods()
  // Paths start at points of the visible regions of every pixel, which are found once, exactly
  // (limn/core/visible_regions.h), in place of rays from the camera. InputError unless the film has
  // a box filter.
  bool exact_film = false;
  // InputError for others than kRenderSamplers. Scrambled Sobol' points fill a pixel's ranges
  // evenly: a third of the squared error, mostly; but `radiance` then has variances that are too
  // large, as batches are not independent.
  std::string sampler = "independent";
};

RenderResult render(const Scene& scene, const RunSettings& settings,
                    const RenderOptions& options = {});

// One sample done again with all it meets written down, line by line. InputError if the image has
// no such pixel.
std::vector<std::string> trace_sample(const Scene& scene, const RunSettings& settings,
                                      const NonFinite::Place& place,
                                      const RenderOptions& options = {});

}  // namespace limn
