// Batches of reverse mode: tiles in parallel, their contributions added in a fixed order.
#include <fmt/format.h>

#include <algorithm>

#include "integrators/estimates/contributions.h"
#include "integrators/estimates/equal_batches.h"
#include "integrators/estimates/gradient_estimator.h"
#include "limn/core/error.h"
#include "limn/core/parallel.h"

namespace limn {

namespace {

// One estimator of a gradient over one batch.
class GradientRunner {
 public:
  GradientRunner(const GradientEstimator& estimator, const Batch& batch, int threads,
                 ProgressCounter& progress)
      : estimator_(estimator),
        batch_(batch),
        threads_(threads),
        progress_(progress),
        sum_(estimator.gradient_slots()) {
    sums_.costs.resize(estimator.slots());
  }

  BatchSums run() {
    if (estimator_.samples_pixels()) {
      run_tiles(estimator_.tiles(batch_), estimator_.pixel_slot(),
                [&](size_t tile, GradientTile& to) { estimator_.add_tile(batch_, tile, to); });
    }
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      if (estimator_.film_samples(slot) > 0) run_film(slot);
    }
    if (progress_.stopped()) return {};
    sums_.images = estimator_.gather(sum_.sums());
    for (auto& numbers : sums_.images) {
      for (double& v : numbers) v *= batch_.count();  // samples add up to their mean
    }
    sums_.images.push_back({static_cast<double>(added_), static_cast<double>(tape_bytes_)});
    return std::move(sums_);
  }

 private:
  void run_film(size_t slot) {
    const FilmBatch film(estimator_, slot, batch_);
    run_tiles(tiles_of(film.count), slot, [&](size_t tile, GradientTile& to) {
      std::vector<FilmDraw> draws;
      const size_t first = tile * kTileSamples;
      for (size_t i = first; i < std::min(film.count, first + kTileSamples); ++i) {
        draws.push_back(film.draw(estimator_, slot, batch_, i));
      }
      estimator_.add_film(slot, draws, to);
    });
  }

  // Contributions are held until they are added, in the order of tiles: of so many tiles, whatever
  // the threads. Seconds that are not booked go to the slot.
  template <class Add>
  void run_tiles(size_t count, size_t slot, const Add& add) {
    constexpr size_t kHeld = 64;  // not tuned
    for (size_t first = 0; first < count && !progress_.stopped(); first += kHeld) {
      std::vector<GradientTile> tiles(std::min(kHeld, count - first));
      std::vector<ContributionSum::Sorted> sorted(tiles.size());
      parallel_for(tiles.size(), threads_, [&](size_t i) {
        if (progress_.stopped()) return;
        const Stopwatch watch;
        GradientTile& own = tiles[i];
        own.costs.resize(estimator_.slots());
        add(first + i, own);
        estimator_.end_tile(own.contributions);
        sorted[i] = sum_.sorted(own.contributions);
        own.contributions = {};
        double booked = 0;
        for (const TermCost& cost : own.costs) booked += cost.seconds;
        own.costs[slot].seconds += watch.seconds() - booked;
        progress_.step();
      });
      sum_.add(sorted, threads_);
      for (size_t i = 0; i < tiles.size(); ++i) join(tiles[i], sorted[i].list.size());
    }
  }

  void join(const GradientTile& own, size_t added) {
    for (size_t slot = 0; slot < own.costs.size(); ++slot) sums_.costs[slot].merge(own.costs[slot]);
    sums_.non_finite.merge(own.non_finite);
    tape_bytes_ = std::max(tape_bytes_, own.tape_bytes);
    added_ += added;
  }

  const GradientEstimator& estimator_;
  const Batch& batch_;
  int threads_;
  ProgressCounter& progress_;
  ContributionSum sum_;
  BatchSums sums_;
  uint64_t added_ = 0, tape_bytes_ = 0;
};

// Of each parameter what a sample, one of so many of its kind, adds to the derivative.
void log_numbers(const GradientEstimator& estimator, const GradientTile& tile, double samples,
                 SampleLog& log) {
  ContributionSum sum(estimator.gradient_slots());
  const ContributionSum::Sorted sorted = sum.sorted(tile.contributions);
  sum.add({&sorted, 1}, 1);
  const std::vector<std::vector<double>> parameters = estimator.gather(sum.sums());
  log.push_back(fmt::format("one of {:.6g} samples of a batch", samples));
  for (size_t i = 0; i < parameters.size(); ++i) {
    const std::vector<double>& numbers = parameters[i];
    double squares = 0;
    for (const double v : numbers) squares += v * v;
    const auto moving =
        std::count_if(numbers.begin(), numbers.end(), [](double v) { return v != 0; });
    log.push_back(
        numbers.size() == 1
            ? fmt::format("sum: parameter {}: {:.6g}", i + 1, numbers[0])
            : fmt::format("sum: parameter {}: {} of {} numbers, root of their squares {:.6g}",
                          i + 1, moving, numbers.size(), std::sqrt(squares)));
  }
  if (tile.non_finite.count > 0) log.push_back(tile.non_finite.message());
}

// That has this sample of every pixel; InputError if the run has none.
Batch batch_of(const GradientEstimator& estimator, RunSettings settings, int64_t sample,
               const NonFinite::SampleId& place) {
  settings.seconds = 0;
  const Stopwatch watch;
  EqualBatches batches(settings, watch, estimator.most_batches());
  while (sample >= 0 && batches.next()) {
    if (batches.end_sample() > sample)
      return {settings.seed, batches.first_sample(), batches.end_sample()};
  }
  throw InputError(fmt::format("there is no sample {} in this run of {} samples per pixel",
                               place.sample, settings.spp));
}

}  // namespace

BatchSums run_batch(const GradientEstimator& estimator, const Batch& batch, int threads,
                    ProgressCounter& progress) {
  return GradientRunner(estimator, batch, threads, progress).run();
}

size_t steps_of(const GradientEstimator& estimator, const Batch& batch) {
  size_t steps = estimator.samples_pixels() ? estimator.tiles(batch) : 0;
  for (size_t slot = 0; slot < estimator.slots(); ++slot) {
    steps += tiles_of(FilmBatch(estimator, slot, batch).count);
  }
  return steps;
}

void run_sample(const GradientEstimator& estimator, const RunSettings& settings,
                const NonFinite::SampleId& place, SampleLog& log) {
  GradientTile tile;
  tile.costs.resize(estimator.slots());
  tile.log = &log;
  if (place.x >= 0) {
    check_pixel(estimator.scene().film, {place.x, place.y, 0, ""});
    const Batch batch = batch_of(estimator, settings, estimator.sample_of(place.sample), place);
    estimator.add_sample(batch, {place.x, place.y, place.sample}, tile);
    return log_numbers(estimator, tile, static_cast<double>(estimator.samples(batch)), log);
  }
  for (size_t slot = 0; slot < estimator.slots(); ++slot) {
    const auto per_sample = static_cast<int64_t>(FilmBatch(estimator, slot, {}).per_sample);
    if (estimator.slot_name(slot) != place.term || per_sample == 0) continue;
    const Batch batch = batch_of(estimator, settings, place.sample / per_sample, place);
    const FilmBatch film(estimator, slot, batch);
    const FilmDraw draw =
        film.draw(estimator, slot, batch, static_cast<size_t>(place.sample) - film.first);
    estimator.add_film(slot, {&draw, 1}, tile);
    return log_numbers(estimator, tile, static_cast<double>(film.count), log);
  }
  throw InputError(fmt::format("the term \"{}\" has no samples on the film here", place.term));
}

}  // namespace limn
