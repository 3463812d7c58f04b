#pragma once
// The contract of what reverse mode estimates: its samples add to the slots of a gradient where
// those of other estimators add to images. Batches, threads, parts, progress, interruption and
// limits of time are the same (batches.h). BatchSums then have no radiance, and in place of images
// for each parameter its numbers, and last what was counted: contributions, and bytes of the
// longest tape.
#include <vector>

#include "integrators/estimates/film_batch.h"
#include "limn/core/tape.h"

namespace limn {

// What the samples of one tile leave. Tiles are joined in their order.
struct GradientTile {
  std::vector<TermCost> costs;  // of each slot of the estimator
  NonFinite non_finite;
  std::vector<Contribution> contributions;
  uint64_t tape_bytes = 0;   // of the longest tape
  SampleLog* log = nullptr;  // null unless somebody reads it
};
// Paths, or samples of the film, in a tile; not tuned.
inline constexpr size_t kTileSamples = 256;
inline size_t tiles_of(size_t samples) { return (samples + kTileSamples - 1) / kTileSamples; }

class GradientEstimator : public SampleEstimator {
 public:
  static constexpr size_t kCounts = 2;  // of what is counted
  // Slots of the gradient, with the unused first one.
  virtual uint32_t gradient_slots() const = 0;
  // Of sums by slot: the derivatives of each parameter's numbers. sizes: how many these are.
  virtual std::vector<std::vector<double>> gather(const std::vector<double>& sums) const = 0;
  virtual std::vector<size_t> sizes() const = 0;

  // A run has so many batches at most, all of one size, since gathering takes time.
  virtual int most_batches() const = 0;
  // The samples of a batch's pixels, in tiles.
  virtual size_t samples(const Batch& batch) const = 0;
  virtual size_t tiles(const Batch& batch) const { return tiles_of(samples(batch)); }
  virtual void add_tile(const Batch& batch, size_t tile, GradientTile& to) const = 0;
  // One of them; the number of a sample tells which of every pixel's samples it belongs to.
  // InputError if the batch has none of this pixel and number.
  virtual int64_t sample_of(int64_t number) const { return number; }
  virtual void add_sample(const Batch& batch, const PixelSample& at, GradientTile& to) const = 0;
  // Samples of the film.
  virtual void add_film(size_t /*slot*/, std::span<const FilmDraw> /*draws*/,
                        GradientTile& /*to*/) const {}
  // What a tile has added, before it is joined.
  virtual void end_tile(std::vector<Contribution>& /*contributions*/) const {}

  // Of images.
  void add_pixels(std::span<const KeyedSample>, SampleSink&) const final {}
};

// For run_batches(): sums over one batch, of no use if stopped meanwhile, and its steps.
BatchSums run_batch(const GradientEstimator& estimator, const Batch& batch, int threads,
                    ProgressCounter& progress);
size_t steps_of(const GradientEstimator& estimator, const Batch& batch);

// One sample alone, with all it meets and what it adds: of a pixel (x >= 0), or one of a slot's
// samples of the film. settings: those of the run, without a limit of time. InputError if the run
// has no such sample.
void run_sample(const GradientEstimator& estimator, const RunSettings& settings,
                const NonFinite::SampleId& place, SampleLog& log);

}  // namespace limn
