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

// A derivative image from differences of images.
struct DifferenceEstimate {
  DifferenceEstimate() = default;
  DifferenceEstimate(const Film& film, int block);
  Moments total;      // crop_height by crop_width by 3, per unit of the parameter
  Moments blocks;     // one value per square block of pixels: the sum over its pixels and channels
  Moments image_sum;  // one value: the sum over all pixels and channels
  Events events;      // single samples that see the other side of a moving edge
  void add_batch(const std::vector<double>& sums, const Film& film, int block, int samples);
};

struct CentralDifferences {
  std::vector<DifferenceEstimate> estimates;  // one per combination
  int64_t spp = 0;
  uint64_t rays = 0;
  double seconds = 0;
  double setup_seconds = 0;  // moved scenes and their ray tracers
  NonFinite non_finite;
};
// D_j = (I(+h_j) - I(-h_j)) / 2 h_j with common random numbers for all steps h_j at once, and
// weighted sums of them: combinations[k] holds a weight for every step.
CentralDifferences central_differences(const Scene& scene, const std::string& parameter,
                                       const std::vector<double>& steps,
                                       const std::vector<std::vector<double>>& combinations,
                                       int block, const RunSettings& settings);

// Central differences for the steps h and 2h, and their Richardson combination
// (4 D_h - D_2h) / 3, whose bias is of order h^4. All from the same samples; standard errors from
// batches hold for each.
struct DifferenceResult {
  DifferenceEstimate at_step, at_double_step, extrapolated;
  int64_t spp = 0;
  uint64_t rays = 0;
  double seconds = 0;
  NonFinite non_finite;
};
DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings);

}  // namespace limn
