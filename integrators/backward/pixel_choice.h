#pragma once
// Which pixels the paths of a reverse pass go through.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "integrators/estimates/batches.h"
#include "limn/core/discrete_distribution.h"
#include "limn/core/film.h"
#include "limn/core/rng.h"
#include "limn/core/vec.h"

namespace limn {

// A path with the number of paths that its pixel has on average in the batch.
struct PixelPath {
  size_t pixel;     // of the crop, row by row
  uint64_t sample;  // distinguishes the random numbers of a pixel's paths
  double expected;
};

class PixelChoice {
 public:
  // adjoint: of the crop's pixels. uniform: all alike; else a quarter of the paths (not tuned) is
  // spread evenly and the rest in proportion to the adjoint's magnitude, in strata along the rows.
  PixelChoice(const std::vector<Rgb<double>>& adjoint, bool uniform);

  // Of a batch: its samples of every pixel, or as many paths spread over the pixels.
  // share: of these; uniform pixels have all.
  size_t paths(const Batch& batch, double share = 1) const {
    const size_t all = choice_.size() * batch.count();
    return share == 1 ? all : std::max<size_t>(1, std::llround(share * static_cast<double>(all)));
  }
  // all: paths() of the batch.
  PixelPath path(const Batch& batch, size_t index, size_t all) const;
  // Of a path to be of this pixel.
  double probability(size_t pixel) const { return choice_.probability(pixel); }
  // The sample per pixel that the path of this number belongs to, and the index in its batch of
  // that path of a pixel.
  int64_t sample_of(int64_t number) const {
    return uniform_ ? number : number / static_cast<int64_t>(choice_.size());
  }
  size_t index_of(const Batch& batch, size_t pixel, int64_t number) const {
    return uniform_ ? pixel * batch.count() + number - batch.first
                    : number - choice_.size() * batch.first;
  }

 private:
  bool uniform_;
  DiscreteDistribution choice_;
};

}  // namespace limn
