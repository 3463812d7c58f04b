// Splits edges by the surface area heuristic.
#include "edgetree/quadric/quadric_node.h"

#include <algorithm>
#include <array>
#include <limits>

#include "limn/core/bounds.h"

namespace limn {
namespace {

constexpr int kPlanes = 10;

struct Box {
  float low[3], high[3];
  Box() {
    std::fill_n(low, 3, std::numeric_limits<float>::max());
    std::fill_n(high, 3, std::numeric_limits<float>::lowest());
  }
  void add(const Box& other) {
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], other.low[k]);
      high[k] = std::max(high[k], other.high[k]);
    }
  }
  float area() const {
    const float x = high[0] - low[0], y = high[1] - low[1], z = high[2] - low[2];
    return x * y + y * z + z * x;
  }
};

struct Item {
  Box box;
  uint32_t wedge;
};

// The bin of an item's center between the planes.
struct Bins {
  int axis;
  float low, scale;
  int operator()(const Item& item) const {
    const float center = 0.5f * (item.box.low[axis] + item.box.high[axis]);
    return std::clamp(static_cast<int>((center - low) * scale), 0, kPlanes);
  }
};

// Number of bins to the left of the best plane; 0 if all items are on one side.
int best_plane(std::span<const Item> items, const Bins& bin_of) {
  Box boxes[kPlanes + 1];
  uint32_t counts[kPlanes + 1] = {};
  for (const Item& item : items) {
    const int bin = bin_of(item);
    boxes[bin].add(item.box);
    ++counts[bin];
  }
  Box right;
  uint32_t right_count = 0;
  float right_cost[kPlanes + 1] = {};
  for (int b = kPlanes; b > 0; --b) {
    right.add(boxes[b]);
    right_count += counts[b];
    right_cost[b] = right_count > 0 ? right.area() * static_cast<float>(right_count) : 0;
  }
  Box left;
  uint32_t left_count = 0;
  int best = 0;
  float best_cost = std::numeric_limits<float>::max();
  for (int b = 1; b <= kPlanes; ++b) {
    left.add(boxes[b - 1]);
    left_count += counts[b - 1];
    if (left_count == 0 || left_count == items.size()) continue;
    const float cost = left.area() * static_cast<float>(left_count) + right_cost[b];
    if (cost < best_cost) {
      best_cost = cost;
      best = b;
    }
  }
  return best;
}

// Partitions the items and returns the number on the left: at least one, not all.
uint32_t split(std::span<Item> items) {
  Box box;
  for (const Item& item : items) box.add(item.box);
  int axis = 0;
  for (int k = 1; k < 3; ++k)
    if (box.high[k] - box.low[k] > box.high[axis] - box.low[axis]) axis = k;
  const Bins bin_of{axis, box.low[axis], (kPlanes + 1) / (box.high[axis] - box.low[axis])};
  const int best = best_plane(items, bin_of);
  if (best == 0) return static_cast<uint32_t>(items.size() / 2);
  const auto middle = std::partition(items.begin(), items.end(),
                                     [&](const Item& item) { return bin_of(item) < best; });
  return static_cast<uint32_t>(middle - items.begin());
}

class Splitter {
 public:
  explicit Splitter(std::span<Item> items) : items_(items) {}

  SplitNode<kQuadricWidth> operator()(EdgeRange range) const {
    SplitNode<kQuadricWidth> node;
    node.range = range;
    node.has_edges = range.size() <= kQuadricWidth;
    if (node.has_edges) return node;
    int lane = 0;
    for (const EdgeRange part : halves(range))
      for (const EdgeRange child : halves(part))
        if (child.size() > 0) node.ranges[lane++] = child;
    return node;
  }

 private:
  std::array<EdgeRange, 2> halves(EdgeRange range) const {
    if (range.size() <= kQuadricWidth) return {range, EdgeRange{}};
    const uint32_t middle = range.begin + split(items_.subspan(range.begin, range.size()));
    return {EdgeRange{range.begin, middle}, EdgeRange{middle, range.end}};
  }

  std::span<Item> items_;
};

// Relative to the center and diagonal of all edges, so that areas neither overflow nor underflow.
std::vector<Item> items_of(std::span<const Wedge> wedges) {
  Bounds bounds;
  for (const Wedge& wedge : wedges)
    for (const Vec3d& x : wedge.ends) bounds.extend(x);
  const Vec3d center = bounds.center();
  const double diagonal = bounds.diagonal(), scale = diagonal > 0 ? 1 / diagonal : 1;
  std::vector<Item> items(wedges.size());
  for (uint32_t i = 0; i < items.size(); ++i) {
    items[i].wedge = i;
    for (const Vec3d& x : wedges[i].ends)
      for (int k = 0; k < 3; ++k) {
        const auto value = static_cast<float>((x[k] - center[k]) * scale);
        items[i].box.low[k] = std::min(items[i].box.low[k], value);
        items[i].box.high[k] = std::max(items[i].box.high[k], value);
      }
  }
  return items;
}

}  // namespace

QuadricShape shape_of(std::span<const Wedge> wedges, int threads) {
  std::vector<Item> items = items_of(wedges);
  QuadricShape shape =
      split_tree<kQuadricWidth>(static_cast<uint32_t>(items.size()), threads, Splitter(items));
  for (const Item& item : items) shape.order.push_back(item.wedge);
  return shape;
}

}  // namespace limn
