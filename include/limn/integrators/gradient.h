#pragma once
// Derivatives of the image with respect to scene parameters, in forward mode: unbiased, with
// standard errors.
//   dI/dtheta = interior (what slides within continuous regions) + camera (silhouettes on the film)
//   + boundary (silhouettes that shading points see), after Li et al. 2018 with directions held
//   fixed in solid angle everywhere.
#include <array>
#include <optional>
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/integrators/moments.h"
#include "limn/integrators/run.h"

namespace limn {

enum Term { kInterior = 0, kCamera = 1, kBoundary = 2 };
inline constexpr int kTermCount = 3;
const char* term_name(int term);

// What one sample per pixel holds of each term. Each term is averaged over its own, so that all
// results have the same mean whatever the counts.
struct SampleCounts {
  int interior = 1;   // paths; 1 if the interior term is not computed
  double camera = 1;  // points on edges that the camera sees, per pixel; may be less than one
  int boundary = 1;   // edges at every vertex of the first path
  bool operator==(const SampleCounts&) const = default;
};
// "3,0.5,1": in the order of the terms.
std::string to_string(const SampleCounts& samples);

struct GradientOptions {
  std::vector<std::string> parameters;
  std::array<bool, kTermCount> terms = {true, true, true};
  std::string sampler = "brute";  // how shading points choose an edge, see edge_sampler.h
  // None: chosen for the least squared error after equal time, all parameters alike, by a pilot of
  // two to eight samples per pixel with a seed of its own, which are then thrown away. One of each
  // if spp is less than 16, for one term alone, or if less than two samples of the pilot fit into
  // an eighth of the limit of time. The choice does not depend on clocks but for that; it does on
  // the crop.
  std::optional<SampleCounts> samples = SampleCounts{};
  int block = 0;  // also keep moments of sums over blocks of this many pixels
};

// Derivative images of one parameter, crop_height by crop_width by 3, per unit of the parameter.
struct ParameterGradient {
  std::string name;
  Moments total;
  std::array<Moments, kTermCount> terms;
  // One value per block: the sum over its pixels and channels. Empty unless asked for.
  Moments total_blocks;
  std::array<Moments, kTermCount> term_blocks;
  Moments image_sum;  // one value: the sum over all pixels and channels
  Events events;      // of the camera and boundary terms together
};

// What one term cost. Times are summed over threads.
struct TermCost {
  double seconds = 0;
  uint64_t rays = 0;
  // Where the samples of the camera and boundary terms went.
  uint64_t samples = 0;
  uint64_t no_edge = 0;      // the sampler ended without an edge
  uint64_t zero_weight = 0;  // below the horizon, or without relative motion
  uint64_t occluded = 0;     // the edge point is hidden (or, for the camera, off the film)
  uint64_t counted = 0;
  void merge(const TermCost& other);
};

struct GradientResult {
  std::vector<ParameterGradient> parameters;  // in the order asked for
  Moments radiance;                           // the image itself, from the same paths
  std::array<TermCost, kTermCount> costs;
  int64_t spp = 0;       // samples per pixel that were finished
  SampleCounts samples;  // what each of them held
  int pilot_spp = 0;     // samples per pixel of the pilot that chose them
  double seconds = 0;
  double setup_seconds = 0;  // edges, samplers, ray tracer, pilot
  NonFinite non_finite;
  std::vector<std::string> warnings;
};

// More than kLanes parameters take several passes over the same samples. InputError for unknown
// parameters or samplers, and for counts that are not positive.
GradientResult gradient(const Scene& scene, const GradientOptions& options,
                        const RunSettings& settings);

}  // namespace limn
