// Contributions are sorted into ranges of slots, which are added in parallel.
#include "integrators/estimates/contributions.h"

#include <algorithm>

#include "limn/core/parallel.h"

namespace limn {

void join_slots(std::vector<Contribution>& list) {
  std::stable_sort(list.begin(), list.end(),
                   [](const Contribution& a, const Contribution& b) { return a.slot < b.slot; });
  size_t count = 0;
  for (const Contribution& c : list) {
    if (count > 0 && list[count - 1].slot == c.slot) {
      list[count - 1].value += c.value;
    } else {
      list[count++] = c;
    }
  }
  list.resize(count);
}

ContributionSum::Sorted ContributionSum::sorted(const std::vector<Contribution>& list) const {
  const auto range = [&](uint32_t slot) { return slot * kRanges / sums_.size(); };
  Sorted result;
  for (const Contribution& c : list) ++result.begins[range(c.slot) + 1];
  for (size_t r = 0; r < kRanges; ++r) result.begins[r + 1] += result.begins[r];
  auto next = result.begins;
  result.list.resize(list.size());
  for (const Contribution& c : list) result.list[next[range(c.slot)]++] = c;
  return result;
}

void ContributionSum::add(std::span<const Sorted> lists, int threads) {
  parallel_for(kRanges, threads, [&](size_t r) {
    for (const Sorted& sorted : lists) {
      for (size_t i = sorted.begins[r]; i < sorted.begins[r + 1]; ++i) {
        sums_[sorted.list[i].slot] += sorted.list[i].value;
      }
    }
  });
}

}  // namespace limn
