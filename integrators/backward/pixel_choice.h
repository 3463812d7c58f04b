#pragma once
// Which pixels the paths of a reverse pass go through.
#include <cstdint>
#include <vector>

#include "limn/core/discrete_distribution.h"
#include "limn/core/film.h"
#include "limn/core/rng.h"
#include "limn/core/vec.h"

namespace limn {

// The paths of a batch: samples [first, last) of every pixel, or as many paths spread over the
// pixels.
struct PathBatch {
  uint64_t seed;
  int first, last;
  int count() const { return last - first; }
};

// A path with the number of paths that its pixel has on average in the batch.
struct PixelPath {
  size_t pixel;     // of the crop, row by row
  uint64_t sample;  // tells the random numbers of a pixel's paths apart
  double expected;
};

class PixelChoice {
 public:
  // adjoint: of the crop's pixels. uniform: all alike; else a quarter of the paths (not tuned) is
  // spread evenly and the rest in proportion to the adjoint's magnitude, in strata along the rows.
  PixelChoice(const std::vector<Rgb<double>>& adjoint, bool uniform);

  size_t paths(const PathBatch& batch) const { return choice_.size() * batch.count(); }
  PixelPath path(const PathBatch& batch, size_t index) const;

 private:
  bool uniform_;
  DiscreteDistribution choice_;
};

}  // namespace limn
