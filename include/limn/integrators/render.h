#pragma once
// Images of a scene.
#include <string>
#include <vector>

#include "limn/core/blur.h"
#include "limn/core/scene.h"
#include "limn/integrators/film_points.h"
#include "limn/integrators/method.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

struct RenderResult {
  Moments radiance;  // crop_height by crop_width by 3
  int64_t spp = 0;   // samples per pixel that were finished
  uint64_t rays = 0;
  double seconds = 0;
  NonFinite non_finite;
  std::vector<std::string> warnings;
};

// What an image shows.
enum class RenderWhat {
  kImage,   // radiance [W / (m^2 sr)]
  kDirect,  // of light that was scattered once at most: by paths of two segments
  // Of what the camera sees, the part of the sky that nothing hides, weighed by the cosine to the
  // shading normal over pi, and unweighed over 2 pi, both over the half sphere above the face; 1
  // where the camera sees the sky. The same in all channels. By methods that look around alone.
  kAmbientOcclusion,
  kOpenness
};
inline constexpr const char* kRenderWhat[] = {"image", "direct", "ao", "openness"};

// Where the random numbers of a pixel's samples come from. The first is what `limn render` takes,
// the second that of RenderOptions and Python, where variances are requested.
inline constexpr const char* kGenerators[] = {"sobol", "independent"};

struct RenderOptions {
  Method method{Task::kImage};              // InputError for one that makes no images
  FilmPoints points = FilmPoints::kRandom;  // InputError for others where light is sampled
  RenderWhat what = RenderWhat::kImage;     // InputError where the method does not know it
  // silhouettes, lines: lines through the sky, 1 to 16384; a quarter of them through an emitter.
  // With a tolerance above 0 (at most 1) they, 8 at least, are doubled until two halves differ by
  // at most twice this part of the result, or until there are 16384, which RenderResult::warnings
  // reports; what is left of the error is no longer without bias. InputError for others.
  int lines = 64;
  double tolerance = 0;
  int rays = 4;  // rays: of each point for each emitter and the sky, 1 to 2^20
  // InputError for others than kGenerators. Owen-scrambled Sobol' points fill a pixel's ranges
  // evenly: a third of the squared error, mostly; but batches are then not independent, and the
  // variances of `radiance` are no error, nor a bound of it: mostly too large, at times too small.
  // Images of other seeds are independent. A sample serves all pixels whose filters reach it, where
  // the filter is no box and reaches 3.5 pixels at most: expectations are the same, errors of
  // pixels depend on each other. Methods that look around take no notice of it: all their
  // numbers are even, with the same variances.
  std::string generator = "independent";
  Blur blur = {};  // of methods that blur; 0: see resolved()
};

RenderResult render(const Scene& scene, const RunSettings& settings,
                    const RenderOptions& options = {});

// One sample done again with all it meets written down, line by line. InputError if the image has
// no such pixel.
std::vector<std::string> trace_sample(const Scene& scene, const RunSettings& settings,
                                      const NonFinite::SampleId& place,
                                      const RenderOptions& options = {});

}  // namespace limn
