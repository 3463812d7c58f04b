#pragma once
// The contract of what a run estimates: what one sample of a pixel adds, and what one sample of the
// film as a whole adds. Batches, tiles, threads, sums, progress and interruption are the same for
// all estimators and stand in batches.h.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "integrators/estimates/shared_place.h"
#include "integrators/estimates/tiles.h"
#include "limn/core/dual.h"
#include "limn/core/film.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"
#include "limn/integrators/run.h"

namespace limn {

// Sample `s` of a pixel of the full film.
struct PixelSample {
  int x, y;
  int64_t s;
};

// With its stream of random numbers.
struct KeyedSample {
  PixelSample at;
  Rng key;
};
// So many of them are worked on together at most, but for estimators that say otherwise.
inline constexpr size_t kMostTogether = 64;

// How the positions of a pixel's samples on the film move [pixels per unit of the parameter]: by
// `tapered`, see terms/filter.cpp.
struct FilmMotion {
  Lanes x, y;
};
// Where a filter ends at once, a box or one that the film's border cuts, positions come to rest:
// over so many pixels. What lies on the end itself, as an edge at rest may, is seen from both sides
// of it by rounding alone. Not tuned.
inline constexpr double kTaper = 1.0 / 64;
// Whether a pixel's filter ends at once at this offset, an end of its range.
inline bool ends_at_once(const Filter& filter, double end) {
  return filter.kind == Filter::Kind::kBox || std::fabs(end) < filter.radius;
}
// 1 but near such ends, where it falls to 0.
inline double taper(const Filter& filter, const Film::Range& range, double offset) {
  double result = 1;
  if (ends_at_once(filter, range.lower)) result = std::min(result, (offset - range.lower) / kTaper);
  if (ends_at_once(filter, range.upper)) result = std::min(result, (range.upper - offset) / kTaper);
  return std::max(result, 0.0);
}
// How the film position (x, y) moves for the pixel (px, py).
inline FilmMotion tapered(const FilmMotion& motion, const Film& film, int px, int py, double x,
                          double y) {
  return {motion.x * taper(film.filter, film.range_x(px), x - (px + 0.5)),
          motion.y * taper(film.filter, film.range_y(py), y - (py + 0.5))};
}

// Of a pixel of the full film; null where its positions are held.
using FilmMotionAt = std::function<const FilmMotion*(int x, int y)>;

// A point on a curve of the film across which radiance is discontinuous, or a particle.
struct FilmSample {
  double x, y;       // film position [pixels]
  Rgb<Lanes> value;  // difference times the curve's normal speed [pixels per unit of parameter],
                     // over the density of the sample [1 / pixel of length]
  // The same of a curve that moves by a pixel along x, or y, against the positions of samples.
  Rgb<double> along_x{}, along_y{};
  // What turns of directions at the first vertex add (DirectionField::turn): amount times this.
  Rgb<double> amount{};
  Vec3d per_turn{};
  // A particle has a radiance, with the derivative `value`, and a position on the film that moves.
  Rgb<double> radiance{};
  FilmMotion moves{};

  void move(const FilmMotion& motion) {
    for (int c = 0; c < 3; ++c) value[c] += motion.x * -along_x[c] + motion.y * -along_y[c];
  }
  void turn(const Vec3<Lanes>& by) {
    const Lanes rate = by.x * per_turn.x + by.y * per_turn.y + by.z * per_turn.z;
    for (int c = 0; c < 3; ++c) value[c] += rate * amount[c];
  }
};

// What a sample met, line by line, for reading.
using SampleLog = std::vector<std::string>;

// Sums over one batch.
struct BatchSums {
  std::vector<double> radiance;  // crop_height by crop_width by 3
  // images[slot * lanes + lane], the same shape: derivatives.
  std::vector<std::vector<double>> images;
  std::vector<TermCost> costs;  // of each slot
  NonFinite non_finite;
};

// How many paths a pixel takes of each sample that serves it: so many, or all there are.
struct PathsTaken {
  int x0 = 0, y0 = 0, width = 0;  // of the film's crop
  std::vector<uint8_t> counts;    // of its pixels; empty: all
  int at(int x, int y) const { return counts[static_cast<size_t>(y - y0) * width + (x - x0)]; }
};

// A path of a sample, or what is drawn along it.
struct SharedPath {
  const SharedPlace* place = nullptr;  // null: its own pixel's alone
  int number = 0, paths = 1;           // which of the sample's paths, and how many there are
  const PathsTaken* taken = nullptr;   // null: all take it, with its weight
};

// Where the samples of one tile go. Pixels of different tiles do not overlap unless samples are
// shared, so that tiles share the images; costs and what was not finite are a tile's own.
class SampleSink {
 public:
  // film: of the images. served: the pixels that shared samples serve.
  SampleSink(const Film& film, const Tile& served, int lanes, const Lanes& lane_scale,
             BatchSums& images, std::vector<TermCost>& costs, NonFinite& non_finite, SampleLog* log)
      : film_(film),
        served_(served),
        lanes_(lanes),
        lane_scale_(lane_scale),
        sums_(images),
        costs_(costs),
        non_finite_(non_finite),
        log_(log) {}

  void add_radiance(const PixelSample& at, const Rgb<double>& radiance, double weight,
                    const SharedPath& path = {}) {
    share(at, weight, path, [&](size_t index, double share) {
      for (int c = 0; c < 3; ++c) sums_.radiance[index + c] += radiance[c] * share;
    });
  }
  // Three sums; they stay where they are until the batch ends.
  double* radiance_at(int x, int y) { return &sums_.radiance[pixel_index(film_, x, y)]; }
  void add(size_t slot, const PixelSample& at, const Rgb<Lanes>& value, double weight,
           const SharedPath& path = {}) {
    std::vector<double>* const images = &sums_.images[slot * lanes_];
    for (int k = 0; k < lanes_; ++k) {
      if (images[k].empty()) images[k].assign(film_size(film_), 0.0);
    }
    share(at, weight, path, [&](size_t index, double share) {
      for (int k = 0; k < lanes_; ++k) {
        for (int c = 0; c < 3; ++c) images[k][index + c] += value[c][k] * share;
      }
    });
    const double squares = path.place ? path.place->squares : 1;
    costs_[slot].largest.add(squares * squared_magnitude(value, weight, lanes_, lane_scale_),
                             {at.x, at.y, at.s, ""});
  }
  // Calls add(x, y, k) for pixels that samples reach that lie in a pixel and are shared: k counts
  // the weights of SharedPlace.
  template <class Add>
  void serve(const PixelSample& at, int reach, const Add& add) const {
    const bool all =
        served_.holds(at.x - reach, at.y - reach) && served_.holds(at.x + reach, at.y + reach);
    size_t k = 0;
    for (int row = -reach; row <= reach; ++row) {
      for (int column = -reach; column <= reach; ++column, ++k) {
        const int x = at.x - column, y = at.y - row;
        if (all || served_.holds(x, y)) add(x, y, k);
      }
    }
  }
  // A sample that is not finite: it counts as zero and is reported.
  void reject(const PixelSample& at, const std::string& name) {
    non_finite_.add({at.x, at.y, at.s, name});
  }
  TermCost& cost(size_t slot) { return costs_[slot]; }
  SampleLog* log() const { return log_; }  // null unless somebody reads it

  static double squared_magnitude(const Rgb<Lanes>& value, double weight, int lanes,
                                  const Lanes& lane_scale) {
    double sum = 0;
    for (int k = 0; k < lanes; ++k) {
      const double w = weight * lane_scale[k];
      for (int c = 0; c < 3; ++c) sum += value[c][k] * w * (value[c][k] * w);
    }
    return sum;
  }

 private:
  // Calls add(pixel_index, weight) for all pixels that the sample adds to.
  template <class Add>
  void share(const PixelSample& at, double weight, const SharedPath& path, const Add& add) const {
    if (!path.place) return add(pixel_index(film_, at.x, at.y), weight);
    serve(at, path.place->reach, [&](int x, int y, size_t k) {
      double part = weight;
      if (path.taken) {
        const int taken = std::min(path.paths, path.taken->at(x, y));
        if (path.number >= taken) return;
        part = 1.0 / taken;
      }
      add(pixel_index(film_, x, y), path.place->weights[k] * part);
    });
  }

  const Film& film_;
  Tile served_;
  int lanes_;
  const Lanes& lane_scale_;
  BatchSums& sums_;
  std::vector<TermCost>& costs_;
  NonFinite& non_finite_;
  SampleLog* log_;
};

// How the random numbers of a pixel's samples depend on each other.
enum class Numbers {
  kIndependent,
  kEvenInBatches,  // Rng::even of a batch alone: batches are independent
  kEvenInRun       // of all: what batches differ by is no error then, nor a bound of it
};
// SharedPlace::reach_of; 0 where numbers, and so pixels, are independent.
inline int shared_reach(const Film& film, Numbers numbers) {
  return numbers == Numbers::kIndependent ? 0 : SharedPlace::reach_of(film);
}

// Thread-safe: all of it is const.
class SampleEstimator {
 public:
  virtual ~SampleEstimator() = default;

  virtual const Scene& scene() const = 0;
  // Slots hold a cost each, and a derivative image for each lane.
  virtual size_t slots() const = 0;
  virtual const char* slot_name(size_t slot) const = 0;
  virtual int lanes() const { return 0; }
  virtual Lanes lane_scale() const { return {}; }  // natural steps of the parameters

  virtual Numbers numbers() const { return Numbers::kIndependent; }
  // All that at most together() samples of one tile add, each to its own pixel alone. What goes
  // together changes no bit, nor does their number. Seconds that are not booked on a slot go to
  // pixel_slot().
  virtual bool samples_pixels() const { return true; }
  virtual size_t pixel_slot() const { return 0; }
  virtual size_t together() const { return kMostTogether; }
  virtual void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const = 0;
  // Where samples of pixels are shared: SharedPlace::reach_of() the film, how many places a sample
  // has, and the same for samples that lie in their pixels at these, from places[i] on, each for
  // all pixels that it serves. 0: none is.
  virtual int reach() const { return 0; }
  virtual int places() const { return 1; }
  virtual void add_shared(std::span<const KeyedSample> /*samples*/,
                          std::span<const SharedPlace* const> /*places*/,
                          SampleSink& /*sink*/) const {}

  // Samples of a slot that belong to the film as a whole: how many per pixel (0: none), and one of
  // them: `u` in [0, 1) is stratified over a batch, `key` is for everything else. False if it adds
  // nothing.
  virtual double film_samples(size_t /*slot*/) const { return 0; }
  // How the positions of a pixel's samples on the film move; null if they are held.
  virtual const FilmMotion* film_motion(int /*x*/, int /*y*/) const { return nullptr; }
  // How directions at the first vertices of a pixel's paths turn (DirectionField::turn); null if
  // they are held.
  virtual const Vec3<Lanes>* turn(int /*x*/, int /*y*/) const { return nullptr; }
  // Distinguishes the streams of different slots.
  virtual int film_stream(size_t /*slot*/) const { return 0; }
  virtual bool sample_film(size_t /*slot*/, double /*u*/, const Rng& /*key*/, RayCount& /*rays*/,
                           FilmSample& /*sample*/) const {
    return false;
  }
};

}  // namespace limn
