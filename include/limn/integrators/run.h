#pragma once
// What every rendering job has in common: samples, seed, threads, progress, interruption, and what
// it reports.
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <vector>

namespace limn {

class BatchStore;

struct RunSettings {
  int spp = 4;  // samples per pixel; with a limit of time, at most this many
  // Seconds for the whole run, set-up included; 0: no limit. As many samples as fit, but at least
  // `least_spp` (or spp, if that is less). The result has the same bits as that of a run without
  // limit and with the number of samples that this one came to.
  double seconds = 0;
  int least_spp = 1;
  uint64_t seed = 0;
  int threads = 1;
  // Called now and then with the fraction done, from any thread, never concurrently.
  std::function<void(double)> progress;
  // Set from outside (Ctrl-C): the batch in progress is dropped, finished batches are kept.
  const std::atomic<bool>* interrupted = nullptr;
  // Of a run whose batches several processes make (parts.h); null: all are made here. No part has a
  // limit of time.
  BatchStore* store = nullptr;
};

// Samples that came out infinite or not a number. They count as zero, and the run must end with an
// error.
struct NonFinite {
  struct SampleId {
    int x, y;  // pixel of the full film; -1 for samples that do not belong to one
    int64_t sample;
    std::string term;
  };
  uint64_t count = 0;
  std::vector<SampleId> first;  // at most ten
  void add(const SampleId& place);
  void merge(const NonFinite& other);
  // "3 non-finite samples, first at pixel (x, y), sample s, term t; ..."
  std::string message() const;
};

// Rays that were traced on behalf of one term.
struct RayCount {
  uint64_t closest = 0;
  uint64_t shadow = 0;
  uint64_t total() const { return closest + shadow; }
};

// The largest of a set of samples, to find those that rule an error.
struct LargestSample {
  double square = 0;   // its squared magnitude: over channels and parameters, each in units of its
                       // natural step
  double squares = 0;  // the same, summed over all samples
  NonFinite::SampleId place{-1, -1, 0, ""};
  void add(double squared_magnitude, const NonFinite::SampleId& where);
  void merge(const LargestSample& other);
  // The share of the sum that this one sample makes, in [0, 1].
  double share() const { return squares > 0 ? square / squares : 0; }
};

// What one term cost, and where its samples went. Times are summed over threads.
struct TermCost {
  double seconds = 0;
  uint64_t rays = 0;         // of both kinds
  uint64_t shadow_rays = 0;  // of which rays that only ask whether something is in the way
  uint64_t samples = 0;
  // Where samples of edges went.
  uint64_t no_edge = 0;      // the sampler ended without an edge
  uint64_t zero_weight = 0;  // below the horizon, or without relative motion
  uint64_t left_out = 0;     // by roulette, for weighing little
  uint64_t occluded = 0;     // the edge point is hidden (or, for the camera, off the film)
  uint64_t counted = 0;
  // Where directions are warped (of paths).
  uint64_t warped = 0;     // directions whose motion auxiliary rays determined
  uint64_t dominated = 0;  // of which one ray held nine tenths of the weights
  uint64_t dropped = 0;    // auxiliary rays on an edge to rounding
  LargestSample largest;
  void add(const RayCount& count) {
    rays += count.total();
    shadow_rays += count.shadow;
  }
  void merge(const TermCost& other);
};

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// How the samples are split: batches of one sample per pixel at first, then of a thirty-second of
// what is done, so that an interrupt always loses little, and there are always enough batches for a
// standard error. If they are even, of powers of two, and sooner of more: 4 from 16 samples on, 8
// from 64, 16 from 128. The larger a batch, the more even its numbers are. Where time is limited,
// the last batch is cut to what is expected to fit, judged by the two batches before.
class Schedule {
 public:
  // `watch` runs since the job began. even: whether batches are (Rng::even).
  Schedule(const RunSettings& settings, const Stopwatch& watch, bool even)
      : settings_(settings), watch_(watch), even_(even) {}
  // Of the batch that begins with sample `first`, where it is not the last.
  static int batch_size(int first, bool even);
  // Goes to the next batch; false if all samples are done or no other fits.
  bool next();
  int first_sample() const { return first_; }
  int end_sample() const { return end_; }
  int samples() const { return end_ - first_; }

 private:
  int samples_in_time(double now) const;

  const RunSettings& settings_;
  const Stopwatch& watch_;
  bool even_;
  int first_ = 0, end_ = 0;
  bool last_ = false;
  // When the last batches began, and their samples: the latest first.
  double began_[2] = {0, 0};
  int before_ = 0;  // samples of the batch before this one
};

// Fraction done, from many threads: of a number of steps, or of the time if that is nearer its end.
class ProgressCounter {
 public:
  ProgressCounter(const RunSettings& settings, const Stopwatch& watch, size_t steps)
      : settings_(settings), watch_(watch), steps_(steps) {}
  void step(size_t count = 1);
  bool stopped() const {
    return settings_.interrupted && settings_.interrupted->load(std::memory_order_relaxed);
  }

 private:
  const RunSettings& settings_;
  const Stopwatch& watch_;
  size_t steps_;
  size_t done_ = 0;
  std::mutex mutex_;
};

}  // namespace limn
