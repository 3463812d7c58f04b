// A tree over boxes that is searched against itself.
#include "edgetree/edges/overlap_tree.h"

#include <algorithm>
#include <limits>

#include "limn/core/parallel.h"

namespace limn {
namespace {

// Boxes of a leaf, at most. Not tuned.
constexpr size_t kLeafSize = 8;
// Parts of a search, at least, where there is that much to search: enough for any number of
// threads. Not tuned.
constexpr size_t kParts = 512;

constexpr float kInfinity = std::numeric_limits<float>::infinity();

double coordinate(const FloatBox& box, int axis) {
  return axis < 3 ? box.lower[axis] : box.upper[axis - 3];
}

}  // namespace

struct OverlapTree::Item {
  FloatBox box;
  uint32_t index;
};

namespace {

// The bounds of the boxes, and the coordinate in which these differ most.
template <class Item>
FloatBox bounds_of(const Item* begin, const Item* end, int& widest) {
  std::array<float, 6> least, most;
  least.fill(kInfinity);
  most.fill(-kInfinity);
  for (const Item* item = begin; item != end; ++item)
    for (int k = 0; k < 3; ++k) {
      least[k] = std::min(least[k], item->box.lower[k]);
      most[k] = std::max(most[k], item->box.lower[k]);
      least[k + 3] = std::min(least[k + 3], item->box.upper[k]);
      most[k + 3] = std::max(most[k + 3], item->box.upper[k]);
    }
  widest = 0;
  for (int k = 1; k < 6; ++k)
    if (most[k] - least[k] > most[widest] - least[widest]) widest = k;
  return {{least[0], least[1], least[2]}, {most[3], most[4], most[5]}};
}

}  // namespace

OverlapTree::OverlapTree(const std::vector<FloatBox>& boxes, int threads) {
  if (boxes.empty()) return;
  std::vector<Item> items(boxes.size());
  for (uint32_t i = 0; i < boxes.size(); ++i) items[i] = {boxes[i], i};
  build(items, threads);
  boxes_.reserve(items.size());
  order_.reserve(items.size());
  for (const Item& item : items) {
    boxes_.push_back(item.box);
    order_.push_back(item.index);
  }
  make_parts();
}

// Level by level, all nodes of a level at once.
void OverlapTree::build(std::vector<Item>& items, int threads) {
  size_t leaves = 1;
  while (leaves * kLeafSize < items.size()) leaves *= 2;
  nodes_.resize(2 * leaves - 1);
  nodes_[0].begin = 0;
  nodes_[0].end = static_cast<uint32_t>(items.size());
  for (size_t count = 1; count <= leaves; count *= 2) {
    const size_t block = std::max<size_t>(1, count / 64);
    parallel_for(count / block, threads, [&](size_t part) {
      for (size_t i = part * block; i < (part + 1) * block; ++i) {
        const auto index = static_cast<uint32_t>(count - 1 + i);
        Node& node = nodes_[index];
        Item *begin = &items[0] + node.begin, *end = &items[0] + node.end;
        int axis;
        node.box = bounds_of(begin, end, axis);
        if (is_leaf(index)) continue;
        const uint32_t middle = node.begin + (node.end - node.begin) / 2;
        std::nth_element(begin, &items[0] + middle, end, [axis](const Item& a, const Item& b) {
          return coordinate(a.box, axis) < coordinate(b.box, axis);
        });
        nodes_[2 * index + 1].begin = node.begin;
        nodes_[2 * index + 1].end = nodes_[2 * index + 2].begin = middle;
        nodes_[2 * index + 2].end = node.end;
      }
    });
  }
}

// The pairs of nodes, again of one level, that a pair leads to; none if their boxes are apart.
int OverlapTree::descend(const Pair& pair, Pair (&next)[4]) const {
  const auto [a, b] = pair;
  if (a != b && !overlap(nodes_[a].box, nodes_[b].box)) return 0;
  int count = 0;
  for (const uint32_t i : {2 * a + 1, 2 * a + 2})
    for (const uint32_t j : {2 * b + 1, 2 * b + 2})
      if (i <= j) next[count++] = {i, j};
  return count;
}

void OverlapTree::make_parts() {
  std::vector<Pair> pairs{{0, 0}};
  while (pairs.size() < kParts) {
    std::vector<Pair> deeper;
    bool any = false;
    for (const Pair& pair : pairs) {
      if (is_leaf(pair.a)) {
        deeper.push_back(pair);
        continue;
      }
      Pair next[4];
      const int count = descend(pair, next);
      deeper.insert(deeper.end(), next, next + count);
      any = true;
    }
    pairs = std::move(deeper);
    if (!any) break;
  }
  parts_ = std::move(pairs);
}

void OverlapTree::visit_pairs(const Pair& pair, const Visit& visit) const {
  if (is_leaf(pair.a)) {
    visit_leaves(pair, visit);
    return;
  }
  Pair next[4];
  const int count = descend(pair, next);
  for (int i = 0; i < count; ++i) visit_pairs(next[i], visit);
}

void OverlapTree::visit_leaves(const Pair& pair, const Visit& visit) const {
  const Node &a = nodes_[pair.a], &b = nodes_[pair.b];
  for (uint32_t i = a.begin; i < a.end; ++i) {
    if (!overlap(boxes_[i], b.box)) continue;
    for (uint32_t j = pair.a == pair.b ? i + 1 : b.begin; j < b.end; ++j)
      if (overlap(boxes_[i], boxes_[j])) visit(i, j);
  }
}

}  // namespace limn
