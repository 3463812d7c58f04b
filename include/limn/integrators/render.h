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

// Derivatives of the image by central differences (I(+h) - I(-h)) / 2h with common random numbers,
// for the parameters' steps h and 2h, and their Richardson combination (4 D_h - D_2h) / 3, whose
// bias is of order h^4. All from the same samples; standard errors from batches hold for each.
struct DifferenceResult {
  Moments at_step, at_double_step, extrapolated;
  // The same over square blocks of pixels: one value per block, the sum over its pixels and
  // channels.
  Moments blocks_at_step, blocks_at_double_step, blocks_extrapolated;
  Moments image_sum;  // one value: the extrapolated difference summed over all pixels and channels
  // Moving edges make differences a sum of rare events: single samples that see the other side. The
  // typical size of an event, sum |x|^3 / sum x^2 over the pixels' sums of a batch.
  double event_at_step = 0, event_at_double_step = 0, event_extrapolated = 0;
  int64_t spp = 0;
  uint64_t rays = 0;
  double seconds = 0;
  NonFinite non_finite;
};
DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings);

}  // namespace limn
