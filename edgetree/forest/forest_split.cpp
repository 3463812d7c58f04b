// Binned splits of edges by where they are and where their normals point.
#include "edgetree/forest/forest_split.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "limn/core/bounds.h"

namespace limn {
namespace {

constexpr int kAxes = 6;

// How much an extent of the mesh's radius counts against one of a radian in normals. With 1 listing
// visits fewer nodes (1.63 per silhouette of spot, with 8 1.81), but draws are worse by far: edges
// of one node then differ in distance and direction.
constexpr float kPosition = 8;

// Where an edge is, and where its normals point: close in both means rejected together.
struct Item {
  float key[kAxes];
  uint32_t wedge;
};

struct Extent {
  float low[kAxes], high[kAxes];
  Extent() {
    std::fill_n(low, kAxes, std::numeric_limits<float>::max());
    std::fill_n(high, kAxes, std::numeric_limits<float>::lowest());
  }
  void add(const Item& item) {
    for (int k = 0; k < kAxes; ++k) {
      low[k] = std::min(low[k], item.key[k]);
      high[k] = std::max(high[k], item.key[k]);
    }
  }
  void add(const Extent& other) {
    for (int k = 0; k < kAxes; ++k) {
      low[k] = std::min(low[k], other.low[k]);
      high[k] = std::max(high[k], other.high[k]);
    }
  }
  // Grows with the chance that a plane through a random point cuts the set, and with how much its
  // edges differ in distance and direction from there.
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
  uint32_t bin = 0;  // or, where items are sorted, the number of items on the left
};

// Not tuned: sets below this size are sorted along each axis instead of binned.
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

void sort_along(std::span<Item> items, int axis) {
  std::sort(items.begin(), items.end(), [axis](const Item& a, const Item& b) {
    return a.key[axis] != b.key[axis] ? a.key[axis] < b.key[axis] : a.wedge < b.wedge;
  });
}

// Few items: any place in the sorted order that leaves full nodes of edges.
Cut best_place(std::span<Item> items, uint32_t width) {
  Cut best;
  const auto n = static_cast<uint32_t>(items.size());
  const uint32_t step = n > width ? width : 1;
  for (int axis = 0; axis < kAxes; ++axis) {
    sort_along(items, axis);
    float right_cost[kSortBelow];
    Extent right;
    for (uint32_t i = n - 1; i > 0; --i) {
      right.add(items[i]);
      right_cost[i] = right.measure() * static_cast<float>(n - i);
    }
    Extent left;
    for (uint32_t i = 1; i < n; ++i) {
      left.add(items[i - 1]);
      if (i % step != 0) continue;
      const float cost = left.measure() * static_cast<float>(i) + right_cost[i];
      if (cost < best.cost) best = {cost, axis, i};
    }
  }
  return best;
}

// Reorders the items and returns how many go left: at least one, and not all.
uint32_t split(std::span<Item> items, uint32_t width) {
  const auto n = static_cast<uint32_t>(items.size());
  if (n < kSortBelow) {
    const Cut cut = best_place(items, width);
    sort_along(items, cut.axis);
    return cut.bin;
  }
  Extent extent;
  for (const Item& item : items) extent.add(item);
  const Cut cut = best_bin(items, extent);
  if (cut.cost == std::numeric_limits<float>::max()) return n / 2;  // all alike
  const Bins bin_of = bins_of(extent, cut.axis);
  const auto middle = std::partition(items.begin(), items.end(), [&](const Item& item) {
    return bin_of(item.key[cut.axis]) <= cut.bin;
  });
  return static_cast<uint32_t>(middle - items.begin());
}

// The largest part is split until there are `width` parts, or all fit into nodes of edges.
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

std::vector<Item> items_of(std::span<const Wedge> wedges) {
  Bounds bounds;
  for (const Wedge& wedge : wedges)
    for (const Vec3d& x : wedge.ends) bounds.extend(x);
  const Vec3d center = bounds.center();
  const double diagonal = bounds.diagonal(), scale = diagonal > 0 ? 2 / diagonal : 1;
  std::vector<Item> items(wedges.size());
  for (uint32_t i = 0; i < items.size(); ++i) {
    const Wedge& wedge = wedges[i];
    const Vec3d x = ((wedge.ends[0] + wedge.ends[1]) * 0.5 - center) * scale;
    const Vec3d n = (wedge.planes[0].n + wedge.planes[1].n) * 0.5;
    for (int k = 0; k < 3; ++k) {
      items[i].key[k] = static_cast<float>(x[k]);
      items[i].key[k + 3] = static_cast<float>(n[k]);
    }
    items[i].wedge = i;
  }
  return items;
}

}  // namespace

ForestShape split_edges(std::span<const Wedge> wedges, uint32_t width, int threads) {
  std::vector<Item> items = items_of(wedges);
  ForestShape tree =
      split_tree<kWidth>(static_cast<uint32_t>(items.size()), threads, Splitter(items, width));
  for (const Item& item : items) tree.order.push_back(item.wedge);
  return tree;
}

}  // namespace limn
