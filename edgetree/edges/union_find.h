#pragma once
// Disjoint sets of the numbers 0 to count - 1.
#include <cstdint>
#include <numeric>
#include <vector>

namespace limn {

class UnionFind {
 public:
  explicit UnionFind(size_t count) : parents_(count) {
    std::iota(parents_.begin(), parents_.end(), 0u);
  }
  // The number that stands for the set of i. Paths are halved on the way.
  uint32_t root(uint32_t i) {
    while (parents_[i] != i) i = parents_[i] = parents_[parents_[i]];
    return i;
  }
  // The root of b's set becomes that of both.
  void unite(uint32_t a, uint32_t b) { parents_[root(a)] = root(b); }

 private:
  std::vector<uint32_t> parents_;
};

}  // namespace limn
