// Batches of samples over the film: tiles in parallel, sums in a fixed order.
#include "integrators/estimates/batches.h"

#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <cmath>

#include "integrators/estimates/batch_record.h"
#include "integrators/estimates/equal_batches.h"
#include "integrators/estimates/film_batch.h"
#include "integrators/estimates/gradient_estimator.h"
#include "integrators/estimates/shared_place.h"
#include "integrators/estimates/splat.h"
#include "limn/core/error.h"
#include "limn/core/memory.h"
#include "limn/core/parallel.h"
#include "limn/integrators/parts.h"

namespace limn {

namespace {

// Null where an estimator adds to images.
const GradientEstimator* gradient_of(const SampleEstimator& estimator) {
  return dynamic_cast<const GradientEstimator*>(&estimator);
}

Rng key_of(const SampleEstimator& estimator, const Batch& batch, uint64_t pixel, int64_t s) {
  switch (estimator.numbers()) {
    case Numbers::kEvenInBatches:
      return even_in_batch(batch, pixel, s - batch.first);
    case Numbers::kEvenInRun:
      return Rng::even(batch.seed, pixel, static_cast<uint32_t>(s));
    case Numbers::kIndependent:
      break;
  }
  return {batch.seed, pixel, static_cast<uint64_t>(s)};
}
Rng pixel_key(const SampleEstimator& estimator, const Batch& batch, const PixelSample& at) {
  const Camera& camera = estimator.scene().camera;
  uint64_t pixel = static_cast<uint64_t>(at.y) * camera.width + at.x;
  if (at.x < 0 || at.y < 0 || at.x >= camera.width || at.y >= camera.height) {
    // Around the film, see sampled_tiles: numbers that no pixel has.
    constexpr int kMost = SharedPlace::kMostReach;
    const uint64_t row = at.y + kMost;
    pixel = UINT64_MAX - 1 - (row * (camera.width + 2 * kMost) + at.x + kMost);
  }
  return key_of(estimator, batch, pixel, at.s);
}
// Appends those of a sample.
void add_places(const SampleEstimator& estimator, const Batch& batch, int64_t s,
                std::vector<SharedPlace>& places) {
  const Rng key = key_of(estimator, batch, UINT64_MAX, s);
  for (int i = 0; i < estimator.places(); ++i) {
    places.emplace_back(estimator.scene().film.filter, estimator.reach(), key.path(i));
  }
}

// The film in tiles, then, with sample_border, pixels around it that have samples for it.
std::vector<Tile> sampled_tiles(const SampleEstimator& estimator) {
  const Film& film = estimator.scene().film;
  std::vector<Tile> tiles = make_tiles(film);
  const int reach = estimator.reach();
  if (reach == 0 || !film.sample_border) return tiles;
  const auto add = [&](int x, int y, int width, int height) {
    Film part = film;
    part.crop_x = x;
    part.crop_y = y;
    part.crop_width = width;
    part.crop_height = height;
    const std::vector<Tile> more = make_tiles(part);
    tiles.insert(tiles.end(), more.begin(), more.end());
  };
  const int right = film.crop_x + film.crop_width, bottom = film.crop_y + film.crop_height;
  const int width = film.crop_width + 2 * reach;
  add(film.crop_x - reach, film.crop_y - reach, width, reach);
  add(film.crop_x - reach, film.crop_y, reach, film.crop_height);
  add(right, film.crop_y, reach, film.crop_height);
  add(film.crop_x - reach, bottom, width, reach);
  return tiles;
}

// The part of the film that samples of a tile add to.
Film reach_of(const Film& film, const Tile& tile, int reach) {
  Film part = film;
  part.crop_x = std::max(film.crop_x, tile.x0 - reach);
  part.crop_y = std::max(film.crop_y, tile.y0 - reach);
  part.crop_width = std::min(film.crop_x + film.crop_width, tile.x1 + reach) - part.crop_x;
  part.crop_height = std::min(film.crop_y + film.crop_height, tile.y1 + reach) - part.crop_y;
  return part;
}

// One estimator over one batch.
class BatchRunner {
 public:
  BatchRunner(const SampleEstimator& estimator, const Batch& batch, int threads,
              ProgressCounter& progress)
      : estimator_(estimator),
        reach_(estimator.reach()),
        film_(estimator.scene().film),
        served_(served_pixels(film_)),
        batch_(batch),
        threads_(threads),
        progress_(progress),
        lane_scale_(estimator.lane_scale()) {
    sums_.radiance.assign(film_size(film_), 0.0);
    sums_.images.resize(estimator.slots() * estimator.lanes());
    for (auto& image : sums_.images) image.assign(film_size(film_), 0.0);
    sums_.costs.resize(estimator.slots());
    for (int s = batch.first; reach_ > 0 && s < batch.last; ++s) {
      add_places(estimator_, batch, s, places_);
    }
  }

  BatchSums run() {
    if (estimator_.samples_pixels()) run_pixels();
    for (size_t slot = 0; slot < estimator_.slots(); ++slot) {
      if (estimator_.film_samples(slot) > 0) run_film(slot);
    }
    progress_.step(batch_.count());
    return std::move(sums_);
  }

 private:
  void run_pixels() {
    const std::vector<Tile> tiles = sampled_tiles(estimator_);
    std::vector<std::vector<TermCost>> costs(tiles.size());
    std::vector<NonFinite> bad(tiles.size());
    // Tiles of shared samples overlap: so many at most have sums of their own in memory. Not tuned.
    const bool overlap = reach_ > 0;
    const size_t group = overlap ? 512 : tiles.size();
    for (size_t begin = 0; begin < tiles.size(); begin += group) {
      const size_t end = std::min(begin + group, tiles.size());
      std::vector<BatchSums> parts(overlap ? end - begin : 0);
      parallel_for(end - begin, threads_, [&](size_t n) {
        if (progress_.stopped()) return;
        const size_t i = begin + n;
        costs[i].resize(estimator_.slots());
        const Film film = overlap ? reach_of(film_, tiles[i], reach_) : film_;
        if (overlap) {
          parts[n].radiance.assign(film_size(film), 0.0);
          parts[n].images.resize(sums_.images.size());
        }
        SampleSink sink(film, served_, estimator_.lanes(), lane_scale_, overlap ? parts[n] : sums_,
                        costs[i], bad[i], nullptr);
        run_tile(tiles[i], costs[i], sink);
        progress_.step(batch_.count());
      });
      if (progress_.stopped()) return;
      for (size_t n = 0; n < parts.size(); ++n) add_part(tiles[begin + n], parts[n]);
    }
    // Samples are traced by pixels of the film: those around it are not named.
    for (size_t i = 0; i < tiles.size(); ++i) {
      if (is_on_film(tiles[i].x0, tiles[i].y0)) continue;
      for (TermCost& cost : costs[i]) cost.largest = {};
      bad[i].first.clear();
    }
    for (size_t i = 0; i < tiles.size(); ++i) {
      for (size_t slot = 0; slot < costs[i].size(); ++slot) sums_.costs[slot].merge(costs[i][slot]);
      sums_.non_finite.merge(bad[i]);
    }
  }

  void add_part(const Tile& tile, const BatchSums& sums) {
    const Film part = reach_of(film_, tile, reach_);
    add_part(part, sums.radiance, sums_.radiance);
    for (size_t i = 0; i < sums.images.size(); ++i) {
      if (!sums.images[i].empty()) add_part(part, sums.images[i], sums_.images[i]);
    }
  }
  void add_part(const Film& part, const std::vector<double>& image,
                std::vector<double>& sum) const {
    const size_t row = size_t{3} * part.crop_width;
    for (int y = 0; y < part.crop_height; ++y) {
      const double* from = &image[y * row];
      double* to = &sum[pixel_index(film_, part.crop_x, part.crop_y + y)];
      for (size_t i = 0; i < row; ++i) to[i] += from[i];
    }
  }

  void run_tile(const Tile& tile, std::vector<TermCost>& costs, SampleSink& sink) {
    const Stopwatch watch;
    const auto is_any = [](int, int) { return true; };
    const auto is_cut = [&](int x, int y) { return is_on_film(x, y) && !served_.holds(x, y); };
    const auto add = [&](const std::vector<KeyedSample>& together) {
      estimator_.add_pixels(together, sink);
    };
    if (reach_ > 0) {
      std::vector<const SharedPlace*> places;
      in_groups(tile, is_any, [&](const std::vector<KeyedSample>& together) {
        places.clear();
        for (const KeyedSample& one : together) {
          places.push_back(&places_[(one.at.s - batch_.first) * estimator_.places()]);
        }
        estimator_.add_shared(together, places, sink);
      });
      in_groups(tile, is_cut, add);
    } else {
      in_groups(tile, is_any, add);
    }
    double booked = 0;
    for (const TermCost& cost : costs) booked += cost.seconds;
    costs[estimator_.pixel_slot()].seconds += watch.seconds() - booked;
  }

  // Calls add(samples) for all samples of the tile's pixels that `takes`, several at a time.
  template <class Takes, class Add>
  void in_groups(const Tile& tile, const Takes& takes, const Add& add) const {
    std::vector<KeyedSample> together;
    for (int y = tile.y0; y < tile.y1; ++y) {
      for (int x = tile.x0; x < tile.x1; ++x) {
        if (!takes(x, y)) continue;
        for (int s = batch_.first; s < batch_.last; ++s) {
          const PixelSample at{x, y, s};
          together.push_back({at, pixel_key(estimator_, batch_, at)});
          if (together.size() < estimator_.together()) continue;
          add(together);
          together.clear();
        }
      }
    }
    if (!together.empty()) add(together);
  }

  struct Chunk {
    std::vector<std::pair<size_t, FilmSample>> samples;  // with their numbers
    TermCost cost;
    NonFinite bad;
  };

  static constexpr size_t kChunk = 1024;  // not tuned

  void run_film(size_t slot) {
    constexpr size_t kHeld = 1024 * kChunk;  // samples in memory, 304 bytes each; not tuned
    const FilmBatch batch(estimator_, slot, batch_);
    for (size_t begin = 0; begin < batch.count && !progress_.stopped(); begin += kHeld) {
      add_film_samples(slot, batch, begin, std::min(batch.count, begin + kHeld));
    }
    TermCost& cost = sums_.costs[slot];
    cost.samples += batch.count;
    cost.occluded += batch.count - cost.counted;
  }

  void add_film_samples(size_t slot, const FilmBatch& batch, size_t begin, size_t end) {
    std::vector<Chunk> chunks((end - begin + kChunk - 1) / kChunk);
    parallel_for(chunks.size(), threads_, [&](size_t c) {
      if (progress_.stopped()) return;
      const size_t first = begin + c * kChunk;
      run_chunk(slot, batch, first, std::min(end, first + kChunk), chunks[c]);
    });
    // A batch's sum is its number of samples per pixel times its mean; this turns sums over film
    // samples into that.
    const double scale = 1.0 / static_cast<double>(batch.per_sample);
    TermCost& cost = sums_.costs[slot];
    for (const Chunk& chunk : chunks) {
      for (const auto& [number, sample] : chunk.samples) {
        splat(slot, sample, scale);
        cost.largest.add(SampleSink::squared_magnitude(own_value(sample), scale, estimator_.lanes(),
                                                       lane_scale_),
                         {-1, -1, static_cast<int64_t>(number), ""});
      }
      cost.merge(chunk.cost);
      sums_.non_finite.merge(chunk.bad);
    }
  }

  void run_chunk(size_t slot, const FilmBatch& batch, size_t first, size_t last,
                 Chunk& chunk) const {
    const Stopwatch watch;
    RayCount rays;
    for (size_t i = first; i < last; ++i) {
      FilmSample sample;
      const FilmDraw draw = batch.draw(estimator_, slot, batch_, i);
      if (!estimator_.sample_film(slot, draw.u, draw.key, rays, sample)) continue;
      if (is_finite(sample.value) && is_finite(sample.along_x) && is_finite(sample.along_y) &&
          is_finite(sample.amount) && is_finite(sample.radiance) &&
          is_finite(grey(sample.moves.x)) && is_finite(grey(sample.moves.y))) {
        chunk.samples.emplace_back(batch.first + i, sample);
      } else {
        chunk.bad.add({-1, -1, static_cast<int64_t>(batch.first + i), estimator_.slot_name(slot)});
      }
    }
    chunk.cost.counted = chunk.samples.size();
    chunk.cost.add(rays);
    chunk.cost.seconds = watch.seconds();
  }

  bool is_on_film(int x, int y) const {
    return x >= film_.crop_x && y >= film_.crop_y && x < film_.crop_x + film_.crop_width &&
           y < film_.crop_y + film_.crop_height;
  }

  // Adds a sample to the pixels whose filters reach it. Where samples are shared, directions turn
  // as in the pixel that it lies in.
  void splat(size_t slot, const FilmSample& sample, double scale) {
    const Rgb<Lanes> own = own_value(sample);
    const bool is_particle = !is_black(sample.radiance);
    for_every_pixel_of(film_, sample.x, sample.y, [&](int x, int y, double weight) {
      if (is_particle) return add_particle(slot, x, y, sample, weight * scale);
      const bool shared = reach_ > 0 && served_.holds(x, y);
      add(slot, pixel_index(film_, x, y), shared ? own : value_for(x, y, sample), weight * scale);
    });
  }
  // The pixel's filter weighs its light, and less or more as it moves.
  void add_particle(size_t slot, int x, int y, const FilmSample& sample, double weight) {
    const size_t index = pixel_index(film_, x, y);
    for (int c = 0; c < 3; ++c) sums_.radiance[index + c] += sample.radiance[c] * weight;
    const Lanes by_motion = sample.moves.x * log_slope(film_.filter, sample.x - (x + 0.5)) +
                            sample.moves.y * log_slope(film_.filter, sample.y - (y + 0.5));
    Rgb<Lanes> value = sample.value;
    for (int c = 0; c < 3; ++c) value[c] += by_motion * sample.radiance[c];
    add(slot, index, value, weight);
  }

  Rgb<Lanes> value_for(int x, int y, FilmSample sample) const {
    if (const FilmMotion* motion = estimator_.film_motion(x, y)) {
      sample.move(tapered(*motion, film_, x, y, sample.x, sample.y));
    }
    if (const Vec3<Lanes>* turn = estimator_.turn(x, y)) sample.turn(*turn);
    return sample.value;
  }
  // Of the pixel that it lies in, or the nearest to it.
  Rgb<Lanes> own_value(const FilmSample& sample) const {
    const auto nearest = [](double at, int first, int count) {
      return std::clamp(static_cast<int>(std::floor(at)), first, first + count - 1);
    };
    return value_for(nearest(sample.x, film_.crop_x, film_.crop_width),
                     nearest(sample.y, film_.crop_y, film_.crop_height), sample);
  }

  void add(size_t slot, size_t index, const Rgb<Lanes>& value, double weight) {
    const int lanes = estimator_.lanes();
    for (int k = 0; k < lanes; ++k) {
      double* out = &sums_.images[slot * lanes + k][index];
      for (int c = 0; c < 3; ++c) out[c] += value[c][k] * weight;
    }
  }

  const SampleEstimator& estimator_;
  int reach_;  // of shared samples, else 0
  const Film& film_;
  Tile served_;
  const Batch& batch_;
  int threads_;
  ProgressCounter& progress_;
  Lanes lane_scale_;
  BatchSums sums_;
  std::vector<SharedPlace> places_;  // of every sample, if they are shared
};

BatchStore::Task task_of(const RunSettings& settings, int64_t first) {
  return settings.store ? settings.store->task(first) : BatchStore::Task::kMake;
}

void start(BatchStore& store, Estimators estimators, const RunSettings& settings) {
  if (settings.seconds > 0) {
    throw InputError("a run in parts is given by its samples: it takes no limit of time");
  }
  store.identify("samples per pixel", std::to_string(settings.spp));
  store.identify("seed", std::to_string(settings.seed));
  for (const auto& estimator : estimators) {
    store.identify("scene", fingerprint(estimator->scene()));
  }
  store.start(settings.spp);
}

// Batch after batch of a run.
class Batches {
 public:
  Batches(Estimators estimators, const RunSettings& settings, const Stopwatch& watch)
      : seed_(settings.seed),
        growing_(settings, watch,
                 std::any_of(estimators.begin(), estimators.end(),
                             [](const auto& one) { return is_even(*one); })) {
    for (const auto& estimator : estimators) {
      const auto* gradient = gradient_of(*estimator);
      if (gradient) equal_.emplace(settings, watch, gradient->most_batches());
    }
  }
  // See EqualBatches.
  EqualBatches* needs_size() { return equal_ && equal_->needs_size() ? &*equal_ : nullptr; }
  bool next() { return equal_ ? equal_->next() : growing_.next(); }
  Batch batch() const {
    return equal_ ? Batch{seed_, equal_->first_sample(), equal_->end_sample()}
                  : Batch{seed_, growing_.first_sample(), growing_.end_sample()};
  }

 private:
  uint64_t seed_;
  Schedule growing_;
  std::optional<EqualBatches> equal_;  // of reverse mode
};

// Of a run of `spp` samples without a limit of time, that has this sample.
Batch batch_of(const SampleEstimator& estimator, uint64_t seed, int spp, int sample) {
  Batch batch{seed, 0, 0};
  while (batch.last <= sample) {
    batch.first = batch.last;
    const int64_t size = Schedule::batch_size(batch.first, is_even(estimator));
    batch.last = static_cast<int>(std::min<int64_t>(batch.first + size, spp));
  }
  return batch;
}

std::string to_text(const Rgb<Lanes>& value, int lanes) {
  std::string text;
  for (int k = 0; k < lanes; ++k) {
    text += fmt::format("{}({:.6g}, {:.6g}, {:.6g})", k > 0 ? " " : "", value.r[k], value.g[k],
                        value.b[k]);
  }
  return text;
}

}  // namespace

std::vector<BatchSums> run_batch(Estimators estimators, const Batch& batch, int threads,
                                 ProgressCounter& progress) {
  std::vector<BatchSums> sums;
  for (const auto& estimator : estimators) {
    const auto* gradient = gradient_of(*estimator);
    sums.push_back(gradient ? run_batch(*gradient, batch, threads, progress)
                            : BatchRunner(*estimator, batch, threads, progress).run());
    if (progress.stopped()) return {};
  }
  return sums;
}

size_t steps_per_sample(Estimators estimators) {
  size_t steps = 0;
  for (const auto& estimator : estimators) {
    steps += 1;
    if (estimator->samples_pixels()) steps += sampled_tiles(*estimator).size();
  }
  return steps;
}

void check_memory(Estimators estimators) {
  double images = 0;
  for (const auto& estimator : estimators) {
    if (!gradient_of(*estimator))
      images += 1 + static_cast<double>(estimator->slots()) * estimator->lanes();
  }
  if (images == 0) return;
  const Scene& scene = (*estimators.begin())->scene();
  // Of every image: the sums of a batch, of all batches, and what variances are made of.
  const double bytes = 4 * sizeof(double) * images * static_cast<double>(film_size(scene.film));
  require_memory({scene.file}, bytes,
                 fmt::format("a run with {:.0f} images of {} x {} pixels (each term of each "
                             "parameter has one)",
                             images, scene.film.crop_width, scene.film.crop_height),
                 "lower width and height (with -D where the scene has parameters for them), or ask "
                 "for fewer parameters at once");
}

namespace {

// Of the progress, for what is made here.
size_t steps_to_make(Estimators estimators, RunSettings settings) {
  settings.seconds = 0;
  size_t steps = 0;
  const Stopwatch watch;
  Batches batches(estimators, settings, watch);
  while (batches.next()) {
    const Batch batch = batches.batch();
    if (task_of(settings, batch.first) != BatchStore::Task::kMake) continue;
    for (size_t i = 0; i < estimators.size(); ++i) {
      const auto* gradient = gradient_of(*estimators[i]);
      steps += gradient ? steps_of(*gradient, batch)
                        : steps_per_sample(estimators.subspan(i, 1)) * batch.count();
    }
  }
  return std::max<size_t>(1, steps);
}

// How many times a batch has, since estimators are set up for each: one for each sample, unless
// setting up for all faces (about a tenth of a sample of a pixel for each face of 100,000 that
// stand still) would take longer than the samples.
int times_of(Estimators estimators, const Batch& batch) {
  constexpr int64_t kFaces = 10, kAlways = 16;  // faces for a sample of a pixel; not tuned
  const Scene& scene = estimators.front()->scene();
  int64_t faces = 1;
  for (const Shape& shape : scene.shapes) faces += static_cast<int64_t>(shape.mesh.faces.size());
  const int64_t samples = batch.count() * static_cast<int64_t>(film_size(scene.film) / 3);
  return static_cast<int>(
      std::min<int64_t>(batch.count(), std::max(kAlways, kFaces * samples / faces)));
}

// The time of a part of a batch, in [0, 1): stratified, in strata as wide as the parts' shares of
// the samples. If numbers are even in the run and each sample has its own time, times are even in
// the run instead. Larger parts would skip numbers of the sequence: what is left is not even.
double draw_time(Estimators estimators, const Batch& batch, const Batch& part, bool own) {
  const bool even = own && std::ranges::any_of(estimators, [](const auto& estimator) {
                      return estimator->numbers() == Numbers::kEvenInRun;
                    });
  constexpr uint64_t kStream = 0x74696d65;  // apart from pixels
  const auto sample = static_cast<uint32_t>(part.first);
  Rng rng = even ? Rng::even(part.seed, kStream, sample) : Rng(part.seed, kStream, sample);
  if (even) return rng.uniform();
  return (part.first - batch.first + rng.uniform() * part.count()) / batch.count();
}

void add(const std::vector<double>& from, std::vector<double>& to) {
  for (size_t i = 0; i < to.size(); ++i) to[i] += from[i];
}

void merge(const BatchSums& from, const SampleEstimator& estimator, BatchSums& to) {
  add(from.radiance, to.radiance);
  const bool counts = gradient_of(estimator) != nullptr;  // in the last image
  for (size_t i = 0; i + counts < to.images.size(); ++i) add(from.images[i], to.images[i]);
  if (counts) {
    to.images.back()[0] += from.images.back()[0];
    to.images.back()[1] = std::max(to.images.back()[1], from.images.back()[1]);
  }
  for (size_t slot = 0; slot < to.costs.size(); ++slot) to.costs[slot].merge(from.costs[slot]);
  to.non_finite.merge(from.non_finite);
}

// A batch whose samples have times.
std::vector<BatchSums> run_batch_at(const EstimatorsAt& at, Estimators estimators,
                                    const Batch& batch, int threads, ProgressCounter& progress) {
  if (!at) return run_batch(estimators, batch, threads, progress);
  std::vector<BatchSums> sums;
  const int times = times_of(estimators, batch);
  const auto begin = [&](int k) {
    return batch.first + static_cast<int>(int64_t{batch.count()} * k / times);
  };
  for (int k = 0; k < times; ++k) {
    const Batch part{batch.seed, begin(k), begin(k + 1)};
    const EstimatorsAtTime now = at(draw_time(estimators, batch, part, times == batch.count()));
    std::vector<BatchSums> more = run_batch(now.list, part, threads, progress);
    if (progress.stopped()) return {};
    for (size_t i = 0; i < sums.size(); ++i) merge(more[i], *estimators[i], sums[i]);
    if (sums.empty()) sums = std::move(more);
  }
  return sums;
}

}  // namespace

void run_batches(Estimators estimators, const RunSettings& settings, const Stopwatch& watch,
                 const std::function<void(const Batch&, const std::vector<BatchSums>&)>& collect,
                 const EstimatorsAt& at) {
  // What an interrupted pilot chose is no part of a run.
  if (settings.interrupted && settings.interrupted->load()) return;
  if (settings.store) start(*settings.store, estimators, settings);
  ProgressCounter progress(settings, watch, steps_to_make(estimators, settings));
  Batches batches(estimators, settings, watch);
  std::vector<BatchSums> first;  // one sample, by which the size of batches is chosen
  if (EqualBatches* equal = batches.needs_size()) {
    const Stopwatch one;
    first = run_batch_at(at, estimators, {settings.seed, 0, 1}, settings.threads, progress);
    equal->set_size(one.seconds());
  }
  while (!progress.stopped() && batches.next()) {
    const Batch batch = batches.batch();
    const auto task = task_of(settings, batch.first);
    if (task == BatchStore::Task::kLeave) continue;
    std::vector<BatchSums> sums;
    if (task == BatchStore::Task::kRead) {
      sums = to_sums(settings.store->read(batch.first), estimators);
    } else if (!first.empty() && batch.last == 1) {
      sums = std::move(first);
    } else {
      sums = run_batch_at(at, estimators, batch, settings.threads, progress);
      if (progress.stopped()) break;
      if (settings.store) settings.store->write(to_record(batch, sums));
    }
    collect(batch, sums);
  }
}

void check_pixel(const Film& film, const NonFinite::SampleId& place) {
  const int x = place.x - film.crop_x;
  const int y = place.y - film.crop_y;
  if (x >= 0 && x < film.crop_width && y >= 0 && y < film.crop_height && place.sample >= 0 &&
      place.sample < INT_MAX) {
    return;
  }
  throw InputError(fmt::format(
      "there is no sample {} of pixel ({}, {}): pixels of this film are ({}, {}) to ({}, {})",
      place.sample, place.x, place.y, film.crop_x, film.crop_y, film.crop_x + film.crop_width - 1,
      film.crop_y + film.crop_height - 1));
}

void run_pixel_sample(const SampleEstimator& estimator, uint64_t seed, const PixelSample& at,
                      SampleLog& log) {
  BatchSums sums;
  const Film& film = estimator.scene().film;
  sums.radiance.assign(film_size(film), 0.0);
  sums.images.assign(estimator.slots() * estimator.lanes(), sums.radiance);
  std::vector<TermCost> costs(estimator.slots());
  NonFinite bad;
  const Lanes lane_scale = estimator.lane_scale();
  const Tile served = served_pixels(film);
  SampleSink sink(film, served, estimator.lanes(), lane_scale, sums, costs, bad, &log);
  const Batch batch = batch_of(estimator, seed, INT_MAX, static_cast<int>(at.s));
  const KeyedSample one{at, pixel_key(estimator, batch, at)};
  if (estimator.reach() > 0 && served.holds(at.x, at.y)) {
    std::vector<SharedPlace> places;
    add_places(estimator, batch, at.s, places);
    const SharedPlace* const first = places.data();
    estimator.add_shared({&one, 1}, {&first, 1}, sink);
  } else {
    estimator.add_pixels({&one, 1}, sink);
  }
  const size_t index = pixel_index(film, at.x, at.y);
  const auto rgb = [&](const std::vector<double>& image) {
    return fmt::format("({:.6g}, {:.6g}, {:.6g})", image[index], image[index + 1],
                       image[index + 2]);
  };
  log.push_back("sum: radiance " + rgb(sums.radiance));
  for (size_t slot = 0; slot < estimator.slots(); ++slot) {
    for (int k = 0; k < estimator.lanes(); ++k) {
      log.push_back(fmt::format("sum: {} of parameter {}: {}", estimator.slot_name(slot), k + 1,
                                rgb(sums.images[slot * estimator.lanes() + k])));
    }
  }
  if (bad.count > 0) log.push_back(bad.message());
}

static bool run_film_sample(const SampleEstimator& estimator, const RunSettings& settings,
                            size_t slot, int64_t number, SampleLog& log) {
  if (estimator.film_samples(slot) <= 0 || number < 0) return false;
  const auto n = static_cast<size_t>(number);
  const size_t per_sample = FilmBatch(estimator, slot, {}).per_sample;
  if (n / per_sample >= static_cast<size_t>(settings.spp)) return false;
  const Batch batch =
      batch_of(estimator, settings.seed, settings.spp, static_cast<int>(n / per_sample));
  const FilmBatch film(estimator, slot, batch);
  const FilmDraw draw = film.draw(estimator, slot, batch, n - film.first);
  RayCount rays;
  FilmSample sample;
  if (estimator.sample_film(slot, draw.u, draw.key, rays, sample)) {
    log.push_back(fmt::format("film point ({:.6f}, {:.6f}), value over density {}", sample.x,
                              sample.y, to_text(sample.value, estimator.lanes())));
  } else {
    log.push_back("adds nothing");
  }
  log.push_back(fmt::format("{} rays", rays.total()));
  return true;
}

void run_film_sample(const SampleEstimator& estimator, const RunSettings& settings,
                     const NonFinite::SampleId& place, SampleLog& log) {
  for (size_t slot = 0; slot < estimator.slots(); ++slot) {
    if (estimator.slot_name(slot) != place.term) continue;
    if (run_film_sample(estimator, settings, slot, place.sample, log)) return;
  }
  throw InputError(fmt::format("there is no sample {} of the term \"{}\" on the film", place.sample,
                               place.term));
}

}  // namespace limn
