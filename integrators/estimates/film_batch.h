#pragma once
// The random numbers of a batch, and its samples of the film as a whole.
#include <cmath>

#include "integrators/estimates/batches.h"

namespace limn {

inline bool is_even(const SampleEstimator& estimator) {
  return estimator.numbers() == Numbers::kEvenInBatches;
}

// The numbers of all that is even in a batch, by a seed of its own.
inline Rng even_in_batch(const Batch& batch, uint64_t pixel, size_t number) {
  constexpr uint64_t kStream = 0x62617463686573;  // apart from what has the run's own seed
  const uint64_t seed =
      mix_bits(mix_bits(batch.seed + kStream) + static_cast<uint64_t>(batch.first));
  // Of the batch uncut: a sample is the same however many the run has.
  return Rng::even(seed, pixel, static_cast<uint32_t>(number),
                   static_cast<uint32_t>(Schedule::batch_size(batch.first, true)));
}

// A sample of the film as a whole, to be made.
struct FilmDraw {
  int64_t number;  // in the run
  double u;        // in [0, 1), stratified over a batch
  Rng key;         // for everything else
  double share;    // one over the number of its batch's samples
};

// A slot's samples of the film over a batch: the same whole number per sample per pixel in every
// batch, so that all batches weigh alike.
struct FilmBatch {
  size_t per_sample;  // samples of the film for one sample per pixel
  size_t first, count;

  FilmBatch(const SampleEstimator& estimator, size_t slot, const Batch& batch) {
    const Film& film = estimator.scene().film;
    per_sample = static_cast<size_t>(
        std::ceil(estimator.film_samples(slot) * film.crop_width * film.crop_height));
    first = per_sample * batch.first;
    count = per_sample * batch.count();
  }
  // The i-th sample of a batch, in strata along [0, 1): what is even is so along the curves, too.
  FilmDraw draw(const SampleEstimator& estimator, size_t slot, const Batch& batch, size_t i) const {
    const Rng all = is_even(estimator) ? even_in_batch(batch, UINT64_MAX, i)
                                       : Rng(batch.seed, UINT64_MAX, first + i);
    const Rng key = all.copy(Purpose::kFilmCopy, estimator.film_stream(slot));
    const double u = (i + key.at(Purpose::kCamera, 0).uniform()) / count;
    return {static_cast<int64_t>(first + i), u, key, 1 / static_cast<double>(count)};
  }
};

}  // namespace limn
