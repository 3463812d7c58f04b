// A balanced tree over emitters: halves along the longest axis.
#include "limn/core/light_tree.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "limn/core/bounds.h"

namespace limn {
// Two as one: what cancels in the sum of their normals counts as of a closed surface, which shows a
// quarter of its area.
LightTree::Node LightTree::united(const Node& a, const Node& b) {
  Node both;
  both.light = a.light + b.light;
  const double share = both.light > 0 ? a.light / both.light : 0.5;
  both.center = a.center * share + b.center * (1 - share);
  both.facing = a.facing + b.facing;
  both.most = length(both.facing);
  both.rest = a.rest + b.rest + std::max(0.0, a.most + b.most - both.most) / 4;
  const Vec3d to_a = a.center - both.center, to_b = b.center - both.center;
  both.spread =
      share * (a.spread + length_squared(to_a)) + (1 - share) * (b.spread + length_squared(to_b));
  both.radius = std::max(length(to_a) + a.radius, length(to_b) + b.radius);
  return both;
}

LightTree::LightTree(std::span<const Emitter> emitters)
    : order_(emitters.size()), places_(emitters.size()) {
  std::iota(order_.begin(), order_.end(), 0);
  if (emitters.empty()) return;
  nodes_.reserve(2 * emitters.size() - 1);
  build(emitters, 0, emitters.size());
  for (uint32_t i = 0; i < order_.size(); ++i) places_[order_[i]] = i;
}

uint32_t LightTree::build(std::span<const Emitter> emitters, size_t first, size_t count) {
  const auto node = static_cast<uint32_t>(nodes_.size());
  const Emitter& one = emitters[order_[first]];
  nodes_.push_back({one, length(one.facing)});
  if (count == 1) return node;
  Bounds bounds;
  for (size_t i = first; i < first + count; ++i) bounds.extend(emitters[order_[i]].center);
  const Vec3d size = bounds.upper - bounds.lower;
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  const auto begin = order_.begin() + static_cast<std::ptrdiff_t>(first);
  const size_t half = count / 2;
  std::nth_element(begin, begin + static_cast<std::ptrdiff_t>(half),
                   begin + static_cast<std::ptrdiff_t>(count), [&](uint32_t a, uint32_t b) {
                     const double x = emitters[a].center[axis], y = emitters[b].center[axis];
                     return x < y || (x == y && a < b);
                   });
  const uint32_t left = build(emitters, first, half);
  const uint32_t right = build(emitters, first + half, count - half);
  nodes_[node] = united(nodes_[left], nodes_[right]);
  return node;
}

// As in lights.cpp. Of several, some may face p though their mean does not: as if all stood where
// they show most.
double LightTree::sent_to(const Node& node, const Vec3d& p) {
  const Vec3d to = p - node.center;
  const double squared = length_squared(to), distance = std::sqrt(squared);
  const double shown = distance > node.radius
                           ? (dot(node.facing, to) + node.most * node.radius) / distance
                           : node.most;
  return (std::clamp(shown, 0.0, node.most) + node.rest) / (squared + node.spread);
}

double LightTree::share_of_first(size_t node, size_t count, const Vec3d& p) const {
  const double first = sent_to(nodes_[node + 1], p);
  const double second = sent_to(nodes_[second_child(node, count)], p);
  const double sum = first + second;
  return sum > 0 && std::isfinite(sum) ? first / sum : 0.5;
}

size_t LightTree::choose(const Vec3d& p, double u) const {
  size_t node = 0, first = 0, count = size();
  while (count > 1) {
    const double share = share_of_first(node, count, p);
    if (u < share) {
      u /= share;
      node = node + 1;
      count = count / 2;
    } else {
      u = (u - share) / (1 - share);
      node = second_child(node, count);
      first += count / 2;
      count -= count / 2;
    }
    u = std::min(u, 1 - 0x1p-53);
  }
  return order_[first];
}

double LightTree::probability(const Vec3d& p, size_t emitter) const {
  const size_t place = places_[emitter];
  double probability = 1;
  size_t node = 0, first = 0, count = size();
  while (count > 1) {
    const double share = share_of_first(node, count, p);
    const size_t half = count / 2;
    if (place < first + half) {
      probability *= share;
      node = node + 1;
      count = half;
    } else {
      probability *= 1 - share;
      node = second_child(node, count);
      first += half;
      count -= half;
    }
  }
  return probability;
}

}  // namespace limn
