#pragma once
// Sets of numbers that merge.
#include <cstdint>
#include <numeric>
#include <vector>

namespace limn {

// Each of the numbers [0, size) starts in a set of its own.
class UnionFind {
 public:
  explicit UnionFind(size_t size) : parents_(size) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }

  // The number that stands for the set of i.
  uint32_t root(uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  // Merges the set of i into the set of `into`, whose root stands for both.
  void join(uint32_t i, uint32_t into) { parents_[root(i)] = root(into); }

 private:
  std::vector<uint32_t> parents_;
};

}  // namespace limn
