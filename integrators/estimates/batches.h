#pragma once
// The loop that every run shares: batches over the passes' estimators, each over the film's tiles.
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"

namespace limn {

// Samples [first, last) of every pixel.
struct Batch {
  uint64_t seed;
  int first, last;
  int count() const { return last - first; }
};

using Estimators = std::span<const std::unique_ptr<SampleEstimator>>;

// Sums of every estimator over one batch; empty if stopped meanwhile.
std::vector<BatchSums> run_batch(Estimators estimators, const Batch& batch, int threads,
                                 ProgressCounter& progress);

// InputError if memory does not hold the images of a run. To be called before any is made.
void check_memory(Estimators estimators);

// Steps that run_batch reports for each sample of a batch.
size_t steps_per_sample(Estimators estimators);

// The estimators of a run at a time, as at_time() has it, and what they refer to.
struct EstimatorsAtTime {
  std::vector<std::shared_ptr<const void>> kept = {};
  std::vector<std::unique_ptr<SampleEstimator>> list = {};
};
using EstimatorsAt = std::function<EstimatorsAtTime(double u)>;

// Runs batch after batch until all samples are done, the time is over or the run is interrupted.
// collect(batch, sums) takes the sums of every finished batch.
// at: where the scene moves, makes the estimators of a time, of the kind of `estimators`. Each
// sample of all pixels has a time of its own, or several samples have where batches are large;
// times are uniform, and stratified in a batch. Null: the estimators are those of all times.
void run_batches(Estimators estimators, const RunSettings& settings, const Stopwatch& watch,
                 const std::function<void(const Batch&, const std::vector<BatchSums>&)>& collect,
                 const EstimatorsAt& at = nullptr);

// InputError if the film has no such pixel.
void check_pixel(const Film& film, const NonFinite::SampleId& place);

// One sample of a pixel alone: the same whatever the number of samples.
void run_pixel_sample(const SampleEstimator& estimator, uint64_t seed, const PixelSample& at,
                      SampleLog& log);
// One of the film's samples of the slot named as the place's term, by its number in the run.
// InputError if the run has none.
void run_film_sample(const SampleEstimator& estimator, const RunSettings& settings,
                     const NonFinite::SampleId& place, SampleLog& log);

}  // namespace limn
