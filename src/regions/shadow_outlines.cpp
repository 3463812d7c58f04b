// Vertical order of polygon sides, and winding numbers between them.
#include "limn/core/shadow_outlines.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

using Point = ShadowOutlines::Point;
using Wide = __int128;

// Corners within a window's width of it: products of their differences are below 2^62.
constexpr int64_t kNarrow = int64_t{1} << 30;

// Twice the signed area of a triangle: positive if r is to the left of the line from p to q.
template <class Integer>
Integer area(const Point& p, const Point& q, const Point& r) {
  return Integer(q.x - p.x) * (r.y - p.y) - Integer(q.y - p.y) * (r.x - p.x);
}
bool is_narrow(const Point& p) {
  return p.x > -kNarrow && p.x < kNarrow && p.y > -kNarrow && p.y < kNarrow;
}
template <class Integer>
int sign(Integer a) {
  return a > 0 ? 1 : a < 0 ? -1 : 0;
}

}  // namespace

uint32_t& ShadowOutlines::slot_of(const Edge& edge) {
  uint64_t h = 0x9e3779b97f4a7c15;
  for (const int64_t v : {edge.p.x, edge.p.y, edge.q.x, edge.q.y}) {
    h = (h ^ static_cast<uint64_t>(v)) * 0xff51afd7ed558ccd;
    h ^= h >> 32;
  }
  for (size_t i = h;; ++i) {
    uint32_t& slot = table_[i & (table_.size() - 1)];
    if (slot == kEmpty || (sides_[slot].p == edge.p && sides_[slot].q == edge.q)) return slot;
  }
}

// The load factor of the hash table is at most one half.
void ShadowOutlines::grow() {
  table_.assign(2 * table_.size(), kEmpty);
  for (uint32_t i = 0; i < sides_.size(); ++i) slot_of(sides_[i]) = i;
}

void ShadowOutlines::clear() {
  sides_.clear();
  table_.assign(std::max<size_t>(table_.size(), 1024), kEmpty);
}

void ShadowOutlines::add(std::span<const Point> corners, std::span<const uint32_t> tags,
                         bool of_light, uint32_t cancelled) {
  Wide turn = 0;
  for (size_t i = 2; i < corners.size(); ++i) {
    turn += area<Wide>(corners[0], corners[i - 1], corners[i]);
  }
  if (turn == 0) return;
  for (size_t i = 0; i < corners.size(); ++i) {
    const Point &a = corners[i], &b = corners[(i + 1) % corners.size()];
    if (a == b || (cancelled >> i & 1)) continue;
    const bool forward = a < b;
    // The interior is to the left of a counter-clockwise side, and above one that goes right.
    const int change = (turn > 0) == forward ? -1 : 1;
    const bool narrow = is_narrow(a) && is_narrow(b);
    const Edge edge =
        forward ? Edge{a, b, tags[i], 0, 0, narrow} : Edge{b, a, tags[i], 0, 0, narrow};
    uint32_t& slot = slot_of(edge);
    if (slot == kEmpty) {
      slot = static_cast<uint32_t>(sides_.size());
      sides_.push_back(edge);
    }
    Edge& sums = sides_[slot];
    (of_light ? sums.light : sums.cover) += change;
    if (2 * sides_.size() > table_.size()) grow();
  }
}

// Adds the winding numbers that t contributes at the first end of s, and the events where t meets
// s. later: the side that counts as upper if both lie on one line.
void ShadowOutlines::compare(const Edge& s, uint32_t index, bool later, int& light, int& cover) {
  const Edge& t = edges_[index];
  if (t.q <= s.p || s.q <= t.p) return;
  const bool spans_start = t.p <= s.p;
  const auto [s_low, s_high] = std::minmax(s.p.y, s.q.y);
  const auto [t_low, t_high] = std::minmax(t.p.y, t.q.y);
  if (t_high < s_low) return;
  if (t_low > s_high) {
    if (spans_start) light += t.light, cover += t.cover;
    return;
  }
  if (s.narrow && t.narrow) {
    compare_ends<int64_t>(s, index, later, light, cover);
  } else {
    compare_ends<Wide>(s, index, later, light, cover);
  }
}

// compare() for sides of which neither is entirely above the other.
template <class Integer>
void ShadowOutlines::compare_ends(const Edge& s, uint32_t index, bool later, int& light,
                                  int& cover) {
  const Edge& t = edges_[index];
  const bool spans_start = t.p <= s.p;
  // Positions of the ends of s relative to t, and of t relative to s.
  const Integer at_p = area<Integer>(t.p, t.q, s.p), at_q = area<Integer>(t.p, t.q, s.q);
  const int p_of_t = sign(area<Integer>(s.p, s.q, t.p)),
            q_of_t = sign(area<Integer>(s.p, s.q, t.q));
  const bool one_line = at_p == 0 && at_q == 0;
  // True if t is above s where both begin, or at the first end after that.
  const auto is_above = [&](int of_s, int of_s_else, bool from_s, int of_t, int of_t_else) {
    if (one_line) return later;
    if (from_s) return (of_s != 0 ? of_s : of_s_else) < 0;
    return (of_t != 0 ? of_t : of_t_else) > 0;
  };
  const bool begins = is_above(sign(at_p), sign(at_q), spans_start, p_of_t, q_of_t);
  const bool ends = is_above(sign(at_q), sign(at_p), s.q <= t.q, q_of_t, p_of_t);
  if (spans_start && begins) light += t.light, cover += t.cover;
  // Events at ends of t that lie on s.
  const auto along = [&](const Point& x) {
    const double dx = static_cast<double>(s.q.x - s.p.x), dy = static_cast<double>(s.q.y - s.p.y);
    return (static_cast<double>(x.x - s.p.x) * dx + static_cast<double>(x.y - s.p.y) * dy) /
           (dx * dx + dy * dy);
  };
  if (s.p < t.p && p_of_t == 0 && begins) {
    events_.push_back({along(t.p), index, Kind::kFirst, t.light, t.cover});
  }
  if (begins != ends) {
    const double a = static_cast<double>(at_p), b = static_cast<double>(at_q);
    const int up = ends ? 1 : -1;
    events_.push_back({a / (a - b), index, Kind::kIntersection, up * t.light, up * t.cover});
  }
  if (t.q < s.q && q_of_t == 0 && ends) {
    events_.push_back({along(t.q), index, Kind::kSecond, -t.light, -t.cover});
  }
}

// Sides whose bounds allow an effect in compare(), in order. Rounding integers to floats preserves
// their order.
void ShadowOutlines::find_candidates(uint32_t i) {
  const size_t size = edges_.size();
  const float x0 = bounds_.x0[i], x1 = bounds_.x1[i], y0 = bounds_.y0[i];
  const float *x0s = bounds_.x0.data(), *x1s = bounds_.x1.data(), *y1s = bounds_.y1.data();
  near_.resize(size);
  candidates_.resize(size);
  uint32_t* near = near_.data();
  // Written so that the compiler vectorises it.
  for (size_t j = 0; j < size; ++j) {
    near[j] = static_cast<uint32_t>((x1s[j] >= x0) & (x0s[j] <= x1) & (y1s[j] >= y0));
  }
  near[i] = 0;
  size_t count = 0;
  for (uint32_t j = 0; j < size; ++j) {
    candidates_[count] = j;
    count += near[j];
  }
  candidates_.resize(count);
}

void ShadowOutlines::for_each(const std::function<void(const Piece&)>& visit) {
  edges_.clear();
  for (auto* bounds : {&bounds_.x0, &bounds_.x1, &bounds_.y0, &bounds_.y1}) bounds->clear();
  for (const Edge& side : sides_) {
    if (side.light == 0 && side.cover == 0) continue;
    edges_.push_back(side);
    bounds_.x0.push_back(static_cast<float>(side.p.x));
    bounds_.x1.push_back(static_cast<float>(side.q.x));
    bounds_.y0.push_back(static_cast<float>(std::min(side.p.y, side.q.y)));
    bounds_.y1.push_back(static_cast<float>(std::max(side.p.y, side.q.y)));
  }
  for (uint32_t i = 0; i < edges_.size(); ++i) {
    const Edge& s = edges_[i];
    int light = 0, cover = 0;  // above it
    events_.clear();
    find_candidates(i);
    for (const uint32_t j : candidates_) compare(s, j, j > i, light, cover);
    std::stable_sort(events_.begin(), events_.end(),
                     [](const Event& a, const Event& b) { return a.at < b.at; });
    End from{s.tag, Kind::kFirst, s.p};
    const auto finish = [&](const End& to) {
      const bool above = light > 0 && cover == 0;
      const bool below = light + s.light > 0 && cover + s.cover == 0;
      if (above != below) visit({s.tag, s.p, s.q, from, to, above});
      from = to;
    };
    for (const Event& event : events_) {
      const Edge& t = edges_[event.other];
      const auto at = [&](int64_t from_s, int64_t to_s) {
        return from_s + std::llround(event.at * static_cast<double>(to_s - from_s));
      };
      finish({t.tag, event.kind,
              event.kind == Kind::kFirst    ? t.p
              : event.kind == Kind::kSecond ? t.q
                                            : Point{at(s.p.x, s.q.x), at(s.p.y, s.q.y)}});
      light += event.light;
      cover += event.cover;
    }
    finish({s.tag, Kind::kSecond, s.q});
  }
}

}  // namespace limn
