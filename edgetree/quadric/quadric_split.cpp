// Splits of edges by the surface area heuristic.
#include "edgetree/quadric/quadric_split.h"

#include <algorithm>
#include <limits>

#include "limn/core/bounds.h"
#include "limn/core/parallel.h"

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

// The bin between two planes that an item's center lies in.
struct Bins {
  int axis;
  float low, scale;
  int operator()(const Item& item) const {
    const float center = 0.5f * (item.box.low[axis] + item.box.high[axis]);
    return std::clamp(static_cast<int>((center - low) * scale), 0, kPlanes);
  }
};

// The number of bins on the left of the best plane; 0 if all have the same side.
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

// Reorders the items and returns how many go left: at least one, and not all.
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

  // As in the forest's: appends the subtree over a range; ranges of at most `stop` items are left
  // to `pending` as (node, lane).
  struct Pending {
    uint32_t node;
    uint32_t lane;
  };
  uint32_t append(EdgeRange range, uint32_t stop, std::vector<QuadricSplit>& nodes,
                  std::vector<Pending>* pending) const {
    const auto index = static_cast<uint32_t>(nodes.size());
    nodes.push_back(node_over(range));
    if (nodes[index].is_leaf()) return index;
    for (uint32_t lane = 0; lane < kQuadricWidth; ++lane) {
      const EdgeRange child = nodes[index].ranges[lane];
      if (child.size() == 0) continue;
      if (child.size() <= stop) {
        pending->push_back({index, lane});
        continue;
      }
      const uint32_t at = append(child, stop, nodes, pending);
      nodes[index].children[lane] = at;
    }
    return index;
  }

 private:
  std::array<EdgeRange, 2> halves(EdgeRange range) const {
    if (range.size() <= kQuadricWidth) return {range, EdgeRange{}};
    const uint32_t middle = range.begin + split(items_.subspan(range.begin, range.size()));
    return {EdgeRange{range.begin, middle}, EdgeRange{middle, range.end}};
  }
  QuadricSplit node_over(EdgeRange range) const {
    QuadricSplit node;
    node.range = range;
    if (node.is_leaf()) return node;
    const auto parts = halves(range);
    int lane = 0;
    for (const EdgeRange part : parts)
      for (const EdgeRange child : halves(part))
        if (child.size() > 0) node.ranges[lane++] = child;
    return node;
  }

  std::span<Item> items_;
};

// Around the center and in diagonals of all edges: areas neither overflow nor vanish.
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
  const auto n = static_cast<uint32_t>(items.size());
  const Splitter splitter(items);
  constexpr uint32_t kTask = 4096;  // edges that one thread splits alone; not tuned
  QuadricShape shape;
  std::vector<Splitter::Pending> pending;
  splitter.append({0, n}, n > kTask ? kTask : 0, shape.nodes, &pending);
  std::vector<std::vector<QuadricSplit>> parts(pending.size());
  parallel_for(parts.size(), threads, [&](size_t i) {
    const EdgeRange range = shape.nodes[pending[i].node].ranges[pending[i].lane];
    splitter.append(range, 0, parts[i], nullptr);
  });
  for (size_t i = 0; i < parts.size(); ++i) {
    const auto offset = static_cast<uint32_t>(shape.nodes.size());
    shape.parts.push_back(offset);
    shape.nodes[pending[i].node].children[pending[i].lane] = offset;
    for (QuadricSplit& node : parts[i]) {
      for (uint32_t& child : node.children)
        if (child != 0) child += offset;
      shape.nodes.push_back(node);
    }
  }
  shape.parts.push_back(static_cast<uint32_t>(shape.nodes.size()));
  for (const Item& item : items) shape.order.push_back(item.wedge);
  return shape;
}

}  // namespace limn
