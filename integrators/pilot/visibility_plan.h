#pragma once
// How the points of an image look around: by lines between silhouettes, or by rays where these come
// to the same error in less time.
#include <atomic>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "integrators/pilot/sample_plan.h"

namespace limn {

// What of an image has points of the film of its own.
enum class VisibilityPart {
  kAll,
  kEmitters,  // and what shines at the camera
  kPatches,   // what surfaces scatter of small bright patches of the environment: by rays
  kSky        // of all else of it, or how open it is
};

struct VisibilityLook {
  int rays = 0;    // of each point, for each emitter and the sky; 0: by lines
  int points = 1;  // of the film in a sample of a pixel
};

// By cell of the film and by part.
struct VisibilityPlan {
  std::vector<VisibilityPart> parts;
  PlanGrid grid;                      // of one cell where all pixels are alike
  std::vector<VisibilityLook> looks;  // by cell, then by part

  const VisibilityLook& look(int x, int y, size_t part) const {
    return looks[grid.index(x, y) * parts.size() + part];
  }
};

// One look from a point of a pixel, for a pilot: what it shows, and its cost in units of a ray.
struct VisibilityProbe {
  double x = 0, y = 0;  // film position [pixels]
  Rgb<double> value;
  double point_cost = 0;  // of the point itself
  double cost = 0;        // with its look
};
// number: of the point; replicates look around from it by independent lines or rays. reach: 1, or
// of the way from the pixel's center to the point. Thread-safe.
using VisibilityProbing =
    std::function<VisibilityProbe(const PixelSample& at, VisibilityPart part, int rays,
                                  uint64_t number, uint64_t replicate, double reach)>;

// In every cell and for every part what has the least product of variance and cost, each the mean
// over the cell and its surroundings, and so many points that the error of the image after equal
// time is least. A pilot looks at one pixel of each cell of 8 by 8. Costs are counted, so that a
// seed gives the same plan everywhere.
VisibilityPlan plan_visibility(const Film& film, std::span<const VisibilityPart> parts, int threads,
                               const std::atomic<bool>* interrupted,
                               const VisibilityProbing& probe);

}  // namespace limn
