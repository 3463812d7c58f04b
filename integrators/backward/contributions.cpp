// Waves of tiles, whose contributions are sorted into ranges of slots that are added in parallel.
#include "integrators/backward/contributions.h"

#include <algorithm>
#include <array>

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

namespace {

constexpr size_t kRanges = 16;  // of slots; not tuned

// A tile's contributions by ranges of slots, in their own order within each.
struct SortedTile {
  std::vector<Contribution> list;
  std::array<size_t, kRanges + 1> begins{};
};

size_t range_of(uint32_t slot, size_t count) { return slot * kRanges / count; }

SortedTile sorted(const std::vector<Contribution>& list, size_t count) {
  SortedTile tile;
  for (const Contribution& c : list) ++tile.begins[range_of(c.slot, count) + 1];
  for (size_t r = 0; r < kRanges; ++r) tile.begins[r + 1] += tile.begins[r];
  auto next = tile.begins;
  tile.list.resize(list.size());
  for (const Contribution& c : list) tile.list[next[range_of(c.slot, count)]++] = c;
  return tile;
}

}  // namespace

void ContributionSum::add_wave(
    size_t first, size_t last, int threads,
    const std::function<void(size_t, std::vector<Contribution>&)>& make) {
  std::vector<SortedTile> wave(last - first);
  parallel_for(wave.size(), threads, [&](size_t i) {
    std::vector<Contribution> list;
    make(first + i, list);
    wave[i] = sorted(list, sums_.size());
  });
  parallel_for(kRanges, threads, [&](size_t r) {
    for (const SortedTile& tile : wave) {
      for (size_t i = tile.begins[r]; i < tile.begins[r + 1]; ++i) {
        sums_[tile.list[i].slot] += tile.list[i].value;
      }
    }
  });
  for (const SortedTile& tile : wave) added_ += tile.list.size();
}

}  // namespace limn
