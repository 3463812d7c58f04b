// Binned splits of edges by position and direction of normals.
#include "edgetree/forest/forest_build.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "limn/core/bounds.h"

namespace limn {
namespace {

constexpr int kAxes = 6;

// Weight of an extent of the mesh's radius relative to one radian of normals. With 1, listing
// visits fewer nodes (1.63 per silhouette of spot; 1.81 with 8), but draws are much worse: edges of
// a node then differ in distance and direction.
constexpr float kPosition = 8;

// Position and normal direction of an edge: edges close in both are rejected together.
struct Item {
  Floats key;  // by axis; then the bits of the wedge index, and zero

  uint32_t wedge() const { return std::bit_cast<uint32_t>(key[kAxes]); }
};

struct Extent {
  Floats low = splat(std::numeric_limits<float>::max());
  Floats high = splat(std::numeric_limits<float>::lowest());
  void add(const Item& item) {
    low = min(low, item.key);
    high = max(high, item.key);
  }
  void add(const Extent& other) {
    low = min(low, other.low);
    high = max(high, other.high);
  }
  // Increases with the probability that a plane through a random point cuts the set, and with the
  // spread of its edges' distances and directions.
  float measure() const {
    if (low[0] > high[0]) return 0;
    float position = 0, normal = 0;
    for (int k = 0; k < 3; ++k) {
      position += (high[k] - low[k]) * (high[k] - low[k]);
      normal += (high[k + 3] - low[k + 3]) * (high[k + 3] - low[k + 3]);
    }
    return kPosition * std::sqrt(position) + std::sqrt(normal);
  }
};

struct Cut {
  float cost = std::numeric_limits<float>::max();
  int axis = 0;
  uint32_t bin = 0;  // or, for sorted items, the number on the left
};

// Smaller sets are sorted along each axis instead of binned. Not tuned.
constexpr int kBins = 16;
constexpr uint32_t kSortBelow = 96;

struct Bins {
  float low, scale;
  uint32_t operator()(float key) const {
    return std::min(static_cast<uint32_t>((key - low) * scale), uint32_t{kBins - 1});
  }
};
Bins bins_of(const Extent& extent, int axis) {
  const float width = extent.high[axis] - extent.low[axis];
  return {extent.low[axis], kBins / width};
}

Cut best_bin(std::span<const Item> items, const Extent& extent) {
  Cut best;
  for (int axis = 0; axis < kAxes; ++axis) {
    const Bins bin_of = bins_of(extent, axis);
    if (!(extent.high[axis] > extent.low[axis]) || !std::isfinite(bin_of.scale)) continue;
    Extent extents[kBins];
    uint32_t counts[kBins] = {};
    for (const Item& item : items) {
      const uint32_t bin = bin_of(item.key[axis]);
      extents[bin].add(item);
      ++counts[bin];
    }
    float right_cost[kBins];
    Extent right;
    uint32_t right_count = 0;
    for (int b = kBins - 1; b > 0; --b) {
      right.add(extents[b]);
      right_count += counts[b];
      right_cost[b] = right.measure() * static_cast<float>(right_count);
    }
    Extent left;
    uint32_t left_count = 0;
    for (int b = 0; b + 1 < kBins; ++b) {
      left.add(extents[b]);
      left_count += counts[b];
      const float cost = left.measure() * static_cast<float>(left_count) + right_cost[b + 1];
      if (left_count > 0 && left_count < items.size() && cost < best.cost)
        best = {cost, axis, static_cast<uint32_t>(b)};
    }
  }
  return best;
}

// Sort keys with the items' positions in their low halves.
using Order = std::array<uint64_t, kSortBelow>;
uint64_t numbered(uint32_t rising, uint32_t place) { return uint64_t{rising} << 32 | place; }
uint32_t place_in(uint64_t number) { return static_cast<uint32_t>(number); }

// Sorts few items without moving them.
class FewItems {
 public:
  explicit FewItems(std::span<const Item> items) : items_(items) {
    for (uint32_t i = 0; i < items.size(); ++i) by_wedge_[i] = numbered(items[i].wedge(), i);
    std::sort(by_wedge_.begin(), by_wedge_.begin() + items.size());
  }
  // Sorts by key, then by wedge index. Positions in the order are arguments of `at`.
  void sort_along(int axis, Order& order) const {
    for (uint32_t i = 0; i < items_.size(); ++i) {
      const auto bits = std::bit_cast<uint32_t>(at(i).key[axis] + 0.0f);  // -0 is 0
      order[i] = numbered(bits >> 31 ? ~bits : bits | 1u << 31, i);
    }
    std::sort(order.begin(), order.begin() + items_.size());
  }
  const Item& at(uint64_t number) const { return items_[place_in(by_wedge_[place_in(number)])]; }

 private:
  std::span<const Item> items_;
  Order by_wedge_;
};

// The best cut of the sorted order that leaves full nodes of edges.
Cut best_place(const FewItems& items, uint32_t n, uint32_t width) {
  Cut best;
  const uint32_t step = n > width ? width : 1;
  for (int axis = 0; axis < kAxes; ++axis) {
    Order order;
    items.sort_along(axis, order);
    float right_cost[kSortBelow];
    Extent right;
    for (uint32_t i = n - 1; i > 0; --i) {
      right.add(items.at(order[i]));
      if (i % step == 0) right_cost[i] = right.measure() * static_cast<float>(n - i);
    }
    Extent left;
    for (uint32_t i = 1; i < n; ++i) {
      left.add(items.at(order[i - 1]));
      if (i % step != 0) continue;
      const float cost = left.measure() * static_cast<float>(i) + right_cost[i];
      if (cost < best.cost) best = {cost, axis, i};
    }
  }
  return best;
}

uint32_t split_few(std::span<Item> items, uint32_t width) {
  const FewItems few(items);
  const Cut cut = best_place(few, static_cast<uint32_t>(items.size()), width);
  Order order;
  few.sort_along(cut.axis, order);
  std::array<Item, kSortBelow> sorted;
  for (size_t i = 0; i < items.size(); ++i) sorted[i] = few.at(order[i]);
  std::copy_n(sorted.begin(), items.size(), items.begin());
  return cut.bin;
}

// Partitions the items and returns the number on the left: at least one, not all.
uint32_t split(std::span<Item> items, uint32_t width) {
  const auto n = static_cast<uint32_t>(items.size());
  if (n < kSortBelow) return split_few(items, width);
  Extent extent;
  for (const Item& item : items) extent.add(item);
  const Cut cut = best_bin(items, extent);
  if (cut.cost == std::numeric_limits<float>::max()) return n / 2;  // all equal
  const Bins bin_of = bins_of(extent, cut.axis);
  const auto middle = std::partition(items.begin(), items.end(), [&](const Item& item) {
    return bin_of(item.key[cut.axis]) <= cut.bin;
  });
  return static_cast<uint32_t>(middle - items.begin());
}

// Splits the largest part until there are `width` parts, or each fits into a node of edges.
class Splitter {
 public:
  Splitter(std::span<Item> items, uint32_t width) : items_(items), width_(width) {}

  SplitNode<kWidth> operator()(EdgeRange range) const {
    SplitNode<kWidth> node;
    node.range = range;
    node.has_edges = range.size() <= width_;
    if (node.has_edges) {
      for (uint32_t i = 0; i < range.size(); ++i)
        node.ranges[i] = {range.begin + i, range.begin + i + 1};
      return node;
    }
    node.ranges[0] = range;
    for (uint32_t count = 1; count < width_; ++count) {
      EdgeRange& largest = *std::max_element(
          node.ranges.begin(), node.ranges.begin() + count,
          [](const EdgeRange& a, const EdgeRange& b) { return a.size() < b.size(); });
      if (largest.size() <= width_) break;
      const uint32_t left = split(items_.subspan(largest.begin, largest.size()), width_);
      node.ranges[count] = {largest.begin + left, largest.end};
      largest.end = largest.begin + left;
    }
    return node;
  }

 private:
  std::span<Item> items_;
  uint32_t width_;
};

std::vector<Item> items_of(const WedgeList& list) {
  const Bounds bounds = list.bounds();
  const Vec3d center = bounds.center();
  const double diagonal = bounds.diagonal(), scale = diagonal > 0 ? 2 / diagonal : 1;
  std::vector<Item> items(list.size());
  for (uint32_t i = 0; i < items.size(); ++i) {
    const Wedge wedge = list[i];
    const Vec3d x = ((wedge.ends[0] + wedge.ends[1]) * 0.5 - center) * scale;
    const Vec3d n = (wedge.planes[0].n + wedge.planes[1].n) * 0.5;
    for (int k = 0; k < 3; ++k) {
      items[i].key[k] = static_cast<float>(x[k]);
      items[i].key[k + 3] = static_cast<float>(n[k]);
    }
    items[i].key[kAxes] = std::bit_cast<float>(i);
  }
  return items;
}

}  // namespace

ForestShape split_edges(const WedgeList& list, uint32_t width, int threads) {
  std::vector<Item> items = items_of(list);
  ForestShape tree =
      split_tree<kWidth>(static_cast<uint32_t>(items.size()), threads, Splitter(items, width));
  for (const Item& item : items) tree.order.push_back(item.wedge());
  return tree;
}

}  // namespace limn
