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

struct RunSettings {
  int spp = 4;  // samples per pixel
  uint64_t seed = 0;
  int threads = 1;
  // Called now and then with the fraction done, from any thread, never concurrently.
  std::function<void(double)> progress;
  // Set from outside (Ctrl-C): the batch in progress is dropped, finished batches are kept.
  const std::atomic<bool>* interrupted = nullptr;
};

// Samples that came out infinite or not a number. They count as zero, and the run must end with an
// error.
struct NonFinite {
  struct Place {
    int x, y;  // pixel of the full film; -1 for samples that do not belong to one
    int64_t sample;
    std::string term;
  };
  uint64_t count = 0;
  std::vector<Place> first;  // at most ten
  void add(const Place& place);
  void merge(const NonFinite& other);
  // "3 non-finite samples, first at pixel (x, y), sample s, term t; ..."
  std::string message() const;
};

// How the samples are split: batches of one sample per pixel at first, then of a thirty-second of
// what is done, so that an interrupt always loses little, and there are always enough batches for a
// standard error.
struct Batches {
  int count;
  explicit Batches(int spp);
  int first_sample(int batch) const { return ends_[batch]; }
  int samples(int batch) const { return ends_[batch + 1] - ends_[batch]; }

 private:
  std::vector<int> ends_;  // count + 1, from 0 to spp
};

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

// Fraction done over a known number of steps, from many threads.
class ProgressCounter {
 public:
  ProgressCounter(const RunSettings& settings, size_t steps) : settings_(settings), steps_(steps) {}
  void step();
  bool stopped() const {
    return settings_.interrupted && settings_.interrupted->load(std::memory_order_relaxed);
  }

 private:
  const RunSettings& settings_;
  size_t steps_;
  size_t done_ = 0;
  std::mutex mutex_;
};

}  // namespace limn
