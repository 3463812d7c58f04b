#pragma once
// Sums of contributions to a gradient: the same bits on any number of threads, in bounded memory.
#include <functional>
#include <vector>

#include "limn/core/tape.h"

namespace limn {

// One contribution for each slot, in the order of slots: the sum, in the order of the list.
void join_slots(std::vector<Contribution>& list);

class ContributionSum {
 public:
  // count: slots, with the unused first one.
  explicit ContributionSum(uint32_t count) : sums_(count) {}

  // Calls make(tile, list) for the tiles [first, last), in parallel, and adds the lists in the
  // order of tiles. The lists are held until then, so callers take kWave tiles at a time: a fixed
  // number, whatever the threads.
  static constexpr size_t kWave = 64;
  void add_wave(size_t first, size_t last, int threads,
                const std::function<void(size_t, std::vector<Contribution>&)>& make);

  std::vector<double>& sums() { return sums_; }
  uint64_t added() const { return added_; }

 private:
  std::vector<double> sums_;
  uint64_t added_ = 0;
};

}  // namespace limn
