#pragma once
// Central finite differences of images with common random numbers.
#include <optional>

#include "limn/core/blur.h"
#include "limn/core/parameter.h"
#include "limn/core/scene.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

// A derivative image from differences of images.
struct DifferenceEstimate {
  DifferenceEstimate() = default;
  DifferenceEstimate(const Film& film, int block);
  Moments total;      // crop_height by crop_width by 3, per unit of the parameter
  Moments blocks;     // one value per square block of pixels: the sum over its pixels and channels
  Moments image_sum;  // one value: the sum over all pixels and channels
  void add_batch(const std::vector<double>& sums, const Film& film, int block, int samples);
};

// What to compute for one parameter, from D_j = (I(+h_j) - I(-h_j)) / 2 h_j for steps h_j: weighted
// sums of the D_j, combinations[k] holding a weight for every step.
struct DifferenceJob {
  Parameter parameter;
  std::vector<double> steps;
  std::vector<std::vector<double>> combinations;
};

struct CentralDifferences {
  std::vector<std::vector<DifferenceEstimate>> estimates;  // of each job: one per combination
  Moments radiance;  // mean of the moved images of the first job's first step
  int64_t spp = 0;
  TermCost cost;
  double seconds = 0;
  double setup_seconds = 0;  // moved scenes and their ray tracers
  NonFinite non_finite;
};
// All jobs and steps share their random numbers. even: these are even in each batch (Rng::even),
// for less error, mostly. What `check` states of steps and of rare events is of independent ones.
// blur: of images of blurred faces, as resolved() has it. same_paths: changed materials draw as the
// unmoved ones.
CentralDifferences central_differences(const Scene& scene, const std::vector<DifferenceJob>& jobs,
                                       int block, const RunSettings& settings, bool even = false,
                                       const std::optional<Blur>& blur = std::nullopt,
                                       bool same_paths = false);

// Central differences for the steps h and 2h, and their Richardson combination
// (4 D_h - D_2h) / 3, whose bias is of order h^4. All from the same samples; standard errors from
// batches hold for each.
struct DifferenceResult {
  DifferenceEstimate at_step, at_double_step, extrapolated;
  int64_t spp = 0;
  uint64_t rays = 0;
  double seconds = 0;
  double setup_seconds = 0;
  NonFinite non_finite;
};
DifferenceResult finite_differences(const Scene& scene, const std::string& parameter, double step,
                                    int block, const RunSettings& settings,
                                    const std::optional<Blur>& blur = std::nullopt);

}  // namespace limn
