#pragma once
// Sums of contributions to a gradient: the same bits on any number of threads, in bounded memory.
#include <array>
#include <span>
#include <vector>

#include "limn/core/tape.h"

namespace limn {

// One contribution for each slot, in the order of slots: the sum, in the order of the list.
void join_slots(std::vector<Contribution>& list);

class ContributionSum {
 public:
  // count: slots, with the unused first one.
  explicit ContributionSum(uint32_t count) : sums_(count) {}

  static constexpr size_t kRanges = 16;  // of slots; not tuned
  // Contributions by ranges of slots, in their own order within each.
  struct Sorted {
    std::vector<Contribution> list;
    std::array<size_t, kRanges + 1> begins{};
  };
  Sorted sorted(const std::vector<Contribution>& list) const;
  // Adds lists in their order, the ranges in parallel.
  void add(std::span<const Sorted> lists, int threads);

  const std::vector<double>& sums() const { return sums_; }

 private:
  std::vector<double> sums_;
};

}  // namespace limn
