#pragma once
// Disjoint sets with union by index.
#include <cstdint>
#include <numeric>
#include <vector>

namespace limn {

// Initially each of the numbers [0, size) is a set of its own.
class UnionFind {
 public:
  explicit UnionFind(size_t size) : parents_(size) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }

  // The representative of the set of i.
  uint32_t root(uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  // Merges the set of i into that of `into`, whose root becomes the representative.
  void join(uint32_t i, uint32_t into) { parents_[root(i)] = root(into); }

 private:
  std::vector<uint32_t> parents_;
};

}  // namespace limn
