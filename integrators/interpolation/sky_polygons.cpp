// Contours and the horizon, cut where they cross; the number of faces carried around; loops.
#include "integrators/interpolation/sky_polygons.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>

namespace limn {
namespace {

constexpr int kHorizonSides = 16;  // of the polygon that stands for the horizon. Not tuned.
constexpr double kLevel = 1e-7;    // what is lower than this sine lies on the horizon. Not tuned.
constexpr int kBlocked = 1 << 20;  // faces below the horizon
constexpr int kUnknown = -1 << 30;

// An arc above the horizon, from node to node, and the whole edge behind it.
struct Side {
  Vec3d a, b;    // unit, its ends
  Vec3d w0, w1;  // ends of the edge minus p; unset for the horizon
  Vec3d n;       // a x b, unit
  int change;    // of the number of faces, to the left
  uint32_t from, to;
  bool horizon = false;
  std::vector<std::pair<double, uint32_t>> cuts;  // place along it, node
};

// Half of a piece between two nodes: 2 i runs along its side, 2 i + 1 back.
struct Half {
  uint32_t side, node;  // where it starts
  int left = kUnknown;  // the number of faces there
  bool used = false;
};

class Arrangement {
 public:
  Arrangement(const Contours& contours, const ContourPoint& at) : contours_(contours), at_(at) {
    add_contours();
    add_horizon();
    find_crossings();
    cut_up();
    sort_around();
    carry();
  }
  SkyPolygons loops();

 private:
  double height(const Vec3d& w) const { return dot(at_.up, w); }
  uint32_t add_node(const Vec3d& d) {
    nodes_.push_back(d);
    return static_cast<uint32_t>(nodes_.size() - 1);
  }
  uint32_t vertex(const Vec3d& w);
  void add_contours();
  void add_side(const ContourArc& arc, uint32_t from, uint32_t to);
  void add_horizon();
  void find_crossings();
  void cut_where_they_cross(Side& a, Side& b);
  void cut_up();
  void sort_around();
  void carry();
  void seed(uint32_t half);
  int change(uint32_t half) const {
    const Side& side = sides_[halves_[half].side];
    const int along = side.horizon ? -kBlocked : side.change;
    return half % 2 == 0 ? along : -along;
  }
  bool below(uint32_t half) const { return half % 2 == 1 && sides_[halves_[half].side].horizon; }
  Vec3d tangent(uint32_t half) const {
    const Side& side = sides_[halves_[half].side];
    const Vec3d along = cross(side.n, nodes_[halves_[half].node]);
    return half % 2 == 0 ? along : -along;
  }
  SkyCorner corner(const Side& side, const Vec3d& d) const;

  const Contours& contours_;
  const ContourPoint& at_;
  std::vector<Vec3d> nodes_;  // unit directions
  std::map<std::array<float, 3>, uint32_t> vertices_;
  uint32_t vertex_nodes_ = 0;  // nodes below this are vertices of meshes
  std::vector<Side> sides_;
  std::vector<Half> halves_;
  std::vector<uint32_t> starts_, around_;  // outgoing halves of each node, counter-clockwise
  std::vector<uint32_t> place_;            // of a half among these
  int contradictions_ = 0;
};

std::array<float, 3> key_of(const Vec3d& x) {
  return {static_cast<float>(x.x), static_cast<float>(x.y), static_cast<float>(x.z)};
}

uint32_t Arrangement::vertex(const Vec3d& w) {
  const auto [found, fresh] = vertices_.try_emplace(key_of(at_.p + w), 0);
  if (fresh) found->second = add_node(normalize(w));
  return found->second;
}

void Arrangement::add_contours() {
  static thread_local std::vector<ContourArc> arcs;
  arcs.clear();
  contours_.list(at_, {}, nullptr, arcs);
  // Edges in one place count as one.
  std::map<std::pair<uint32_t, uint32_t>, size_t> known;
  std::vector<std::pair<ContourArc, std::pair<uint32_t, uint32_t>>> all;
  for (ContourArc& arc : arcs) {
    std::pair<uint32_t, uint32_t> ends{vertex(arc.w0), vertex(arc.w1)};
    if (ends.first == ends.second) continue;
    if (ends.first > ends.second) {
      std::swap(ends.first, ends.second);
      std::swap(arc.w0, arc.w1);
      arc.change = -arc.change;
    }
    const auto [found, fresh] = known.try_emplace(ends, all.size());
    if (fresh) {
      all.push_back({arc, ends});
    } else {
      all[found->second].first.change += arc.change;
    }
  }
  vertex_nodes_ = static_cast<uint32_t>(nodes_.size());
  for (const auto& [arc, ends] : all) {
    if (arc.change != 0) add_side(arc, ends.first, ends.second);
  }
}

// What of it lies above the horizon.
void Arrangement::add_side(const ContourArc& arc, uint32_t from, uint32_t to) {
  Side side{nodes_[from], nodes_[to], arc.w0, arc.w1, {}, arc.change, from, to, false, {}};
  const double h0 = height(side.a) - kLevel, h1 = height(side.b) - kLevel;
  if (h0 <= 0 && h1 <= 0) return;
  const Vec3d n = cross(side.a, side.b);
  if (!(length_squared(n) > 0)) return;
  side.n = normalize(n);
  if (h0 <= 0 || h1 <= 0) {
    Vec3d d = normalize(side.a + (side.b - side.a) * (h0 / (h0 - h1)));
    d = normalize(d - at_.up * height(d));
    const uint32_t node = add_node(d);
    (h0 <= 0 ? side.a : side.b) = d;
    (h0 <= 0 ? side.from : side.to) = node;
  }
  sides_.push_back(std::move(side));
}

// A ring of sides, counter-clockwise around `up`, cut where contours end on it.
void Arrangement::add_horizon() {
  const Frame frame(at_.up);
  const auto last_contour = static_cast<uint32_t>(nodes_.size());
  const size_t first = sides_.size();
  const auto azimuth = [&](const Vec3d& d) {
    const double turn = std::atan2(dot(d, frame.t), dot(d, frame.s)) / (2 * kPi);
    return (turn < 0 ? turn + 1 : turn) * kHorizonSides;
  };
  for (int i = 0; i < kHorizonSides; ++i) {
    const double phi = 2 * kPi * i / kHorizonSides;
    add_node(frame.s * std::cos(phi) + frame.t * std::sin(phi));
  }
  for (uint32_t i = 0; i < kHorizonSides; ++i) {
    Side side{};
    side.from = last_contour + i, side.to = last_contour + (i + 1) % kHorizonSides;
    side.a = nodes_[side.from], side.b = nodes_[side.to];
    side.n = at_.up;
    side.horizon = true;
    sides_.push_back(std::move(side));
  }
  for (uint32_t node = vertex_nodes_; node < last_contour; ++node) {
    const double turn = azimuth(nodes_[node]);
    const auto i = std::min(static_cast<size_t>(turn), size_t{kHorizonSides - 1});
    sides_[first + i].cuts.push_back({turn - static_cast<double>(i), node});
  }
}

// Pairs of sides whose boxes meet, swept along x.
void Arrangement::find_crossings() {
  struct Box {
    Vec3d low, high;
    uint32_t side;
  };
  std::vector<Box> boxes;
  for (uint32_t i = 0; i < sides_.size(); ++i) {
    const Side& s = sides_[i];
    if (s.horizon) continue;
    const double out = 0.25 * length_squared(s.b - s.a) + 1e-12;
    Box box{{}, {}, i};
    for (int k = 0; k < 3; ++k) {
      box.low[k] = std::min(s.a[k], s.b[k]) - out;
      box.high[k] = std::max(s.a[k], s.b[k]) + out;
    }
    boxes.push_back(box);
  }
  std::sort(boxes.begin(), boxes.end(), [](const Box& a, const Box& b) {
    return a.low.x < b.low.x || (a.low.x == b.low.x && a.side < b.side);
  });
  for (size_t i = 0; i < boxes.size(); ++i) {
    for (size_t j = i + 1; j < boxes.size() && boxes[j].low.x <= boxes[i].high.x; ++j) {
      const Box &a = boxes[i], &b = boxes[j];
      if (a.low.y > b.high.y || b.low.y > a.high.y) continue;
      if (a.low.z > b.high.z || b.low.z > a.high.z) continue;
      cut_where_they_cross(sides_[a.side], sides_[b.side]);
    }
  }
}

double place_on(const Side& side, const Vec3d& d) {
  return std::atan2(dot(cross(side.n, side.a), d), dot(side.a, d));
}

void Arrangement::cut_where_they_cross(Side& a, Side& b) {
  if (a.from == b.from || a.from == b.to || a.to == b.from || a.to == b.to) return;
  if ((dot(a.n, b.a) >= 0) == (dot(a.n, b.b) >= 0)) return;
  if ((dot(b.n, a.a) >= 0) == (dot(b.n, a.b) >= 0)) return;
  Vec3d d = cross(a.n, b.n);
  if (dot(d, a.a + a.b) < 0) d = -d;
  if (!(dot(d, b.a + b.b) > 0)) return;
  const uint32_t node = add_node(normalize(d));
  a.cuts.push_back({place_on(a, nodes_[node]), node});
  b.cuts.push_back({place_on(b, nodes_[node]), node});
}

void Arrangement::cut_up() {
  for (uint32_t i = 0; i < sides_.size(); ++i) {
    std::sort(sides_[i].cuts.begin(), sides_[i].cuts.end());
    uint32_t from = sides_[i].from;
    const auto add = [&](uint32_t to) {
      halves_.push_back({i, from});
      halves_.push_back({i, to});
      from = to;
    };
    for (const auto& [at, node] : sides_[i].cuts) add(node);
    add(sides_[i].to);
  }
}

void Arrangement::sort_around() {
  starts_.assign(nodes_.size() + 1, 0);
  for (const Half& half : halves_) ++starts_[half.node + 1];
  for (size_t i = 0; i < nodes_.size(); ++i) starts_[i + 1] += starts_[i];
  around_.resize(halves_.size());
  place_.resize(halves_.size());
  std::vector<uint32_t> next(starts_.begin(), starts_.end() - 1);
  for (uint32_t h = 0; h < halves_.size(); ++h) around_[next[halves_[h].node]++] = h;
  std::vector<std::pair<double, uint32_t>> angles;
  for (size_t node = 0; node < nodes_.size(); ++node) {
    angles.clear();
    if (starts_[node] == starts_[node + 1]) continue;
    const Frame frame(nodes_[node]);
    for (uint32_t i = starts_[node]; i < starts_[node + 1]; ++i) {
      const Vec3d t = tangent(around_[i]);
      angles.push_back({std::atan2(dot(t, frame.t), dot(t, frame.s)), around_[i]});
    }
    std::sort(angles.begin(), angles.end());
    for (size_t k = 0; k < angles.size(); ++k) {
      around_[starts_[node] + k] = angles[k].second;
      place_[angles[k].second] = static_cast<uint32_t>(k);
    }
  }
}

// The number of faces on the left of a half, counted by a ray.
void Arrangement::seed(uint32_t half) {
  const Half& start = halves_[half];
  const Side& side = sides_[start.side];
  const Vec3d middle = nodes_[start.node] + nodes_[halves_[half ^ 1].node];
  if (side.horizon) {
    const Vec3d d = normalize(middle) + at_.up * (10 * kLevel);
    halves_[half].left = contours_.count(at_, d, nullptr);
    return;
  }
  const auto whole = [&](const Vec3d& w) {
    const auto key = key_of(at_.p + w);
    return Vec3d{key[0], key[1], key[2]};
  };
  const int seen = contours_.count(at_, middle, nullptr);
  const int left = side_of_edge(whole(side.w0), whole(side.w1), at_.p, middle);
  halves_[half].left = left > 0 ? seen : seen + side.change;
}

void Arrangement::carry() {
  std::vector<uint32_t> stack;
  const auto set = [&](uint32_t half, int left) {
    if (halves_[half].left == kUnknown) {
      halves_[half].left = left;
      stack.push_back(half);
    } else if (halves_[half].left != left) {
      ++contradictions_;
    }
  };
  for (uint32_t first = 0; first < halves_.size(); first += 2) {
    if (halves_[first].left != kUnknown) continue;
    seed(first);
    stack.push_back(first);
    while (!stack.empty()) {
      const uint32_t half = stack.back();
      stack.pop_back();
      set(half ^ 1, halves_[half].left - change(half));
      if (below(half)) continue;
      // The next one around has on its right what this one has on its left.
      const uint32_t node = halves_[half].node, count = starts_[node + 1] - starts_[node];
      const uint32_t next = around_[starts_[node] + (place_[half] + 1) % count];
      set(next, halves_[half].left + change(next));
    }
  }
}

SkyCorner Arrangement::corner(const Side& side, const Vec3d& d) const {
  if (side.horizon) return {d, true};
  const Vec3d v = cross(side.n, d);
  const double m0 = dot(v, side.w0), m1 = dot(v, side.w1);
  const double t = m0 == m1 ? 0.5 : std::clamp(m0 / (m0 - m1), 0.0, 1.0);
  return {at_.p + side.w0 + (side.w1 - side.w0) * t, false};
}

SkyPolygons Arrangement::loops() {
  SkyPolygons result;
  result.contradictions = contradictions_;
  for (uint32_t first = 0; first < halves_.size(); ++first) {
    if (halves_[first].left != 0 || halves_[first].used) continue;
    uint32_t half = first;
    while (!halves_[half].used) {
      halves_[half].used = true;
      const uint32_t back = half ^ 1, node = halves_[back].node;
      const uint32_t count = starts_[node + 1] - starts_[node];
      const uint32_t next = around_[starts_[node] + (place_[back] + count - 1) % count];
      const Side &now = sides_[halves_[half].side], &then = sides_[halves_[next].side];
      if (node < vertex_nodes_) {
        const auto x = key_of(at_.p + (now.from == node ? now.w0 : now.w1));
        result.corners.push_back({{x[0], x[1], x[2]}, false});
      } else {
        result.corners.push_back(corner(now, nodes_[node]));
        const SkyCorner second = corner(then, nodes_[node]);
        if (!(second == result.corners.back())) result.corners.push_back(second);
      }
      half = next;
    }
    if (half != first) ++result.contradictions;
    result.starts.push_back(static_cast<uint32_t>(result.corners.size()));
  }
  return result;
}

}  // namespace

SkyPolygons find_sky_polygons(const Contours& contours, const ContourPoint& at) {
  SkyPolygons best = Arrangement(contours, at).loops();
  const Frame frame(at.up);
  for (int k = 1; k <= 3 && best.contradictions > 0; ++k) {
    ContourPoint shifted = at;
    const double shift = k * 1e-6 * (1 + length(at.p));
    shifted.p += frame.s * (shift * std::cos(k)) + frame.t * (shift * std::sin(k));
    SkyPolygons other = Arrangement(contours, shifted).loops();
    if (other.contradictions < best.contradictions) best = std::move(other);
  }
  return best;
}

void look_at(std::span<const SkyCorner> corners, const Vec3d& from,
             std::vector<Vec3d>& directions) {
  for (const SkyCorner& corner : corners) {
    if (corner.far) {
      directions.push_back(corner.q);
      continue;
    }
    const Vec3d w = corner.q - from;
    const double size = length(w);
    directions.push_back(size > 0 ? w / size : Vec3d{0, 1, 0});
  }
}

}  // namespace limn
