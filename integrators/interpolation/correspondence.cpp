// Triples from Voronoi vertices, chosen by two rules, spread to neighbours, completed in order.
#include "integrators/interpolation/correspondence.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <numeric>
#include <set>
#include <tuple>

#include "integrators/interpolation/spherical_delaunay.h"
#include "limn/core/parallel.h"
#include "limn/core/rng.h"

namespace limn {
namespace {

using Indices = std::array<int, 3>;  // in a group's three cycles; -1: not known
constexpr size_t kMostTried = 16;    // corners that could complete a pair. Not tuned.

int cyclic(int way, size_t size) {
  const int n = static_cast<int>(size);
  return way < 0 ? way + n : way;
}

// Loops that belong together: one cycle of corners for each vertex, and the triples so far.
struct Group {
  std::array<std::vector<uint32_t>, 3> cycles;
  std::vector<Indices> items;

  bool crosses(const Indices& at, const Indices* own) const;
  // Drops pairs that other items hold.
  void drop_repeated();
  // Whether the rules of correspondence allow an item with these corners. If so, `same` is set to
  // the item that it completes or repeats, if there is one.
  bool allows(const Indices& at, int& same) const;
};

// Between its neighbours among the items in one cycle, it must be between them in the other.
bool Group::crosses(const Indices& at, const Indices* own) const {
  for (int k = 0; k < 3; ++k) {
    const int a = k, b = (k + 1) % 3;
    if (at[a] < 0 || at[b] < 0) continue;
    const Indices *before = nullptr, *after = nullptr;
    int least_before = 0, least_after = 0;
    for (const Indices& item : items) {
      if (&item == own || item[a] < 0 || item[b] < 0) continue;
      const int back = cyclic(at[a] - item[a], cycles[a].size());
      const int on = cyclic(item[a] - at[a], cycles[a].size());
      if (!before || back < least_before) before = &item, least_before = back;
      if (!after || on < least_after) after = &item, least_after = on;
    }
    if (before == after) continue;  // none, or one
    const int span = cyclic((*after)[b] - (*before)[b], cycles[b].size());
    const int into = cyclic(at[b] - (*before)[b], cycles[b].size());
    if (into == 0 || into >= span) return true;
  }
  return false;
}

void Group::drop_repeated() {
  for (size_t i = items.size(); i-- > 0;) {
    const bool held = std::ranges::any_of(items, [&](const Indices& other) {
      const auto fits = [&](int k) { return items[i][k] < 0 || items[i][k] == other[k]; };
      return &other != &items[i] && fits(0) && fits(1) && fits(2);
    });
    if (held) items.erase(items.begin() + static_cast<int64_t>(i));
  }
}

bool Group::allows(const Indices& at, int& same) const {
  same = -1;
  for (size_t i = 0; i < items.size(); ++i) {
    int shared = 0, known = 0, asked = 0, both = 0;
    for (int k = 0; k < 3; ++k) {
      known += items[i][k] >= 0, asked += at[k] >= 0;
      both += items[i][k] >= 0 && at[k] >= 0;
      shared += at[k] >= 0 && items[i][k] == at[k];
    }
    if (shared == 0) continue;
    if (shared < both || shared < 2 || both < std::min(known, asked)) return false;
    same = static_cast<int>(i);
  }
  return !crosses(at, same < 0 ? nullptr : &items[same]);
}

// A triangle's corners, groups and candidates.
class Match {
 public:
  Match(std::span<const SkyPolygons> skies, const SkyPatch& patch, bool single);

  struct Place {
    int group = -1, index = 0;
  };
  // The group of a corner of vertex k, and its index there. The group is -1 if it is in none, or if
  // the corner is another vertex's.
  Place place(int k, uint32_t corner) const {
    return corner < offsets_[k + 1] - offsets_[k] ? places_[offsets_[k] + corner] : Place{};
  }
  uint32_t corner(int k, const Group& group, int index) const {
    return group.cycles[k][index] - offsets_[k];
  }
  // The next best candidate as a group and its indices.
  bool next(int& group, Indices& at);
  std::vector<uint32_t> nearest(const Group& group, const Indices& at, int k) const;
  SkyTriples finish() const;
  std::vector<Group> groups;

 private:
  struct Candidate {
    double distance;
    std::array<uint32_t, 3> refs;
    auto operator<=>(const Candidate&) const = default;
  };
  void find_candidates();
  void pair_loops();
  void join_loops();
  void add_group(std::array<std::vector<uint32_t>, 3> cycles);
  std::vector<uint32_t> loop(int k, size_t l) const;
  uint32_t nearest_corner(int k, const std::vector<uint32_t>& to) const;
  void merge(const Group& group, const Indices& from, const Indices& steps,
             SkyTriples& result) const;

  std::array<const SkyPolygons*, 3> skies_;
  std::array<uint32_t, 4> offsets_{};
  std::vector<Vec3d> directions_;  // of all corners, from the center
  std::vector<Place> places_;
  std::vector<int> loops_;  // of all corners
  std::vector<Candidate> candidates_;
  size_t next_ = 0;
};

Match::Match(std::span<const SkyPolygons> skies, const SkyPatch& patch, bool single) {
  for (int k = 0; k < 3; ++k) {
    const SkyPolygons& sky = *(skies_[k] = &skies[patch.vertices[k]]);
    look_at(sky.corners, patch.center, directions_);
    offsets_[k + 1] = static_cast<uint32_t>(directions_.size());
    for (size_t l = 0; l < sky.loops(); ++l) {
      loops_.insert(loops_.end(), sky.starts[l + 1] - sky.starts[l], static_cast<int>(l));
    }
  }
  places_.resize(directions_.size());
  find_candidates();
  single ? pair_loops() : join_loops();
}

// Corners in one place are one site with all their colours. Of the corners of a Delaunay triangle,
// every way to take three colours is a candidate.
void Match::find_candidates() {
  std::map<std::tuple<bool, double, double, double>, uint32_t> known;
  std::vector<Vec3d> sites;
  std::vector<std::array<std::vector<uint32_t>, 3>> colours;
  for (int k = 0; k < 3; ++k) {
    for (uint32_t i = 0; i < skies_[k]->corners.size(); ++i) {
      const SkyCorner& c = skies_[k]->corners[i];
      const auto [found, fresh] =
          known.try_emplace({c.far, c.q.x, c.q.y, c.q.z}, static_cast<uint32_t>(sites.size()));
      if (fresh) sites.push_back(directions_[offsets_[k] + i]), colours.emplace_back();
      colours[found->second][k].push_back(offsets_[k] + i);
    }
  }
  const auto angle = [&](uint32_t a, uint32_t b) {
    const double chord = length(directions_[a] - directions_[b]);
    return 2 * std::asin(std::min(1.0, 0.5 * chord));
  };
  std::set<std::array<uint32_t, 3>> seen;
  const auto add = [&](const std::array<uint32_t, 3>& facet) {
    std::array<std::vector<uint32_t>, 3> all;
    for (int k = 0; k < 3; ++k) {
      for (const uint32_t site : std::set<uint32_t>(facet.begin(), facet.end())) {
        all[k].insert(all[k].end(), colours[site][k].begin(), colours[site][k].end());
      }
    }
    for (const uint32_t a : all[0]) {
      for (const uint32_t b : all[1]) {
        for (const uint32_t c : all[2]) {
          if (!seen.insert({a, b, c}).second) continue;
          candidates_.push_back({angle(a, b) + angle(b, c) + angle(c, a), {a, b, c}});
        }
      }
    }
  };
  for (uint32_t i = 0; i < sites.size(); ++i) add({i, i, i});
  for (const auto& facet : spherical_delaunay(sites)) add(facet);
  std::sort(candidates_.begin(), candidates_.end());
}

std::vector<uint32_t> Match::loop(int k, size_t l) const {
  const std::vector<uint32_t>& starts = skies_[k]->starts;
  std::vector<uint32_t> refs(starts[l + 1] - starts[l]);
  std::iota(refs.begin(), refs.end(), offsets_[k] + starts[l]);
  return refs;
}

// The corner of vertex k that is nearest to any of these; the first of these if it has none.
uint32_t Match::nearest_corner(int k, const std::vector<uint32_t>& to) const {
  uint32_t best = to[0];
  double most = -2;
  for (uint32_t ref = offsets_[k]; ref < offsets_[k + 1]; ++ref) {
    for (const uint32_t other : to) {
      const double c = dot(directions_[ref], directions_[other]);
      if (c > most) most = c, best = ref;
    }
  }
  return best;
}

void Match::add_group(std::array<std::vector<uint32_t>, 3> cycles) {
  const int number = static_cast<int>(groups.size());
  for (int k = 0; k < 3; ++k) {
    for (size_t i = 0; i < cycles[k].size(); ++i) {
      const uint32_t ref = cycles[k][i];
      const bool own = ref >= offsets_[k] && ref < offsets_[k + 1];
      if (own && cycles[k].size() > 1 && places_[ref].group < 0) {
        places_[ref] = {number, static_cast<int>(i)};
      }
    }
  }
  groups.push_back({std::move(cycles), {}});
}

// A loop goes with at most one of each other vertex, by most candidates; others shrink to a point.
void Match::pair_loops() {
  std::map<Indices, int> votes;
  for (const Candidate& candidate : candidates_) {
    ++votes[{loops_[candidate.refs[0]], loops_[candidate.refs[1]], loops_[candidate.refs[2]]}];
  }
  std::vector<std::pair<int, Indices>> order;
  for (const auto& [loops, count] : votes) order.push_back({-count, loops});
  std::sort(order.begin(), order.end());
  std::array<std::vector<bool>, 3> taken;
  for (int k = 0; k < 3; ++k) taken[k].resize(skies_[k]->loops());
  for (const auto& [count, l] : order) {
    if (taken[0][l[0]] || taken[1][l[1]] || taken[2][l[2]]) continue;
    for (int k = 0; k < 3; ++k) taken[k][l[k]] = true;
    add_group({loop(0, l[0]), loop(1, l[1]), loop(2, l[2])});
  }
  for (int k = 0; k < 3; ++k) {
    for (size_t l = 0; l < skies_[k]->loops(); ++l) {
      if (taken[k][l]) continue;
      const std::vector<uint32_t> own = loop(k, l);
      std::array<std::vector<uint32_t>, 3> cycles;
      for (int j = 0; j < 3; ++j) {
        cycles[j] = j == k ? own : std::vector<uint32_t>{nearest_corner(j, own)};
      }
      add_group(std::move(cycles));
    }
  }
}

// As published: all loops of a vertex are one sequence, here by way of the first one's start.
void Match::join_loops() {
  std::array<std::vector<uint32_t>, 3> cycles;
  for (int k = 0; k < 3; ++k) {
    for (size_t l = 0; l < skies_[k]->loops(); ++l) {
      const std::vector<uint32_t> own = loop(k, l);
      if (l > 0) cycles[k].push_back(offsets_[k]);
      cycles[k].insert(cycles[k].end(), own.begin(), own.end());
      if (l > 0) cycles[k].push_back(own[0]);
    }
  }
  for (int k = 0; k < 3; ++k) {
    const auto& full = !cycles[0].empty() ? cycles[0] : !cycles[1].empty() ? cycles[1] : cycles[2];
    if (full.empty()) return;
    if (cycles[k].empty()) cycles[k] = {full[0]};
  }
  add_group(std::move(cycles));
}

bool Match::next(int& group, Indices& at) {
  for (; next_ < candidates_.size(); ++next_) {
    const auto& refs = candidates_[next_].refs;
    const Place p[] = {places_[refs[0]], places_[refs[1]], places_[refs[2]]};
    if (p[0].group < 0 || p[1].group != p[0].group || p[2].group != p[0].group) continue;
    group = p[0].group;
    at = {p[0].index, p[1].index, p[2].index};
    ++next_;
    return true;
  }
  return false;
}

// Indices of the k-th cycle, by their distance to the pair.
std::vector<uint32_t> Match::nearest(const Group& group, const Indices& at, int k) const {
  const std::vector<uint32_t>& cycle = group.cycles[k];
  Vec3d pair;
  for (int j = 0; j < 3; ++j) {
    if (j != k) pair += directions_[group.cycles[j][at[j]]];
  }
  std::vector<std::pair<double, uint32_t>> order;
  for (uint32_t i = 0; i < cycle.size(); ++i)
    order.push_back({-dot(pair, directions_[cycle[i]]), i});
  const size_t count = std::min(order.size(), kMostTried);
  std::partial_sort(order.begin(), order.begin() + static_cast<int64_t>(count), order.end());
  std::vector<uint32_t> indices;
  for (size_t i = 0; i < count; ++i) indices.push_back(order[i].second);
  return indices;
}

// Triples from one item to before the next, `steps` on in each cycle: the cycle that lags behind in
// its share of the way goes on, and those whose next place is nearer to where it gets.
void Match::merge(const Group& group, const Indices& from, const Indices& steps,
                  SkyTriples& result) const {
  std::array<std::vector<double>, 3> shares;
  const auto ref = [&](int k, int step) {
    const auto& cycle = group.cycles[k];
    return cycle[(from[k] + step) % static_cast<int>(cycle.size())];
  };
  for (int k = 0; k < 3; ++k) {
    shares[k] = {0};
    for (int i = 0; i < steps[k]; ++i) {
      const double way = length(directions_[ref(k, i + 1)] - directions_[ref(k, i)]);
      shares[k].push_back(shares[k].back() + way + 1e-9);
    }
    for (double& share : shares[k]) share /= std::max(shares[k].back(), 1e-9);
  }
  Indices at{};
  while (true) {
    result.triples.push_back({ref(0, at[0]), ref(1, at[1]), ref(2, at[2])});
    double reach = 2;
    for (int k = 0; k < 3; ++k) {
      if (at[k] + 1 < steps[k]) reach = std::min(reach, shares[k][at[k] + 1]);
    }
    if (reach == 2) break;
    for (int k = 0; k < 3; ++k) {
      const auto& s = shares[k];
      if (at[k] + 1 < steps[k] && 0.5 * (s[at[k]] + s[at[k] + 1]) < reach) ++at[k];
    }
    ++result.relaxed;
  }
}

SkyTriples Match::finish() const {
  SkyTriples result;
  for (const Group& group : groups) {
    std::vector<Indices> items;
    for (const Indices& item : group.items) {
      if (*std::min_element(item.begin(), item.end()) >= 0) items.push_back(item);
    }
    std::sort(items.begin(), items.end());
    items.erase(std::unique(items.begin(), items.end()), items.end());
    if (items.empty()) {
      // The first corner of the longest cycle, and those nearest to it.
      Indices start{};
      int k = 0;
      for (int j = 1; j < 3; ++j) {
        if (group.cycles[j].size() > group.cycles[k].size()) k = j;
      }
      for (int j = 0; j < 3; ++j) {
        if (j == k) continue;
        double most = -2;
        for (size_t i = 0; i < group.cycles[j].size(); ++i) {
          const double c = dot(directions_[group.cycles[j][i]], directions_[group.cycles[k][0]]);
          if (c > most) most = c, start[j] = static_cast<int>(i);
        }
      }
      items.push_back(start);
    }
    for (size_t i = 0; i < items.size(); ++i) {
      const Indices& to = items[(i + 1) % items.size()];
      Indices steps;
      for (int k = 0; k < 3; ++k) {
        steps[k] = cyclic(to[k] - items[i][k], group.cycles[k].size());
        if (items.size() == 1) steps[k] = static_cast<int>(group.cycles[k].size());
      }
      merge(group, items[i], steps, result);
    }
    result.starts.push_back(static_cast<uint32_t>(result.triples.size()));
  }
  return result;
}

// Chooses triples in all patches at once, so that neighbours agree along their edges.
class Selection {
 public:
  Selection(std::span<const SkyPolygons> skies, std::span<const SkyPatch> patches,
            const CorrespondenceOptions& options);
  std::vector<SkyTriples> run();

 private:
  struct Side {
    uint32_t patch;
    int a, b;  // colours there of the side's ends
  };
  struct Pair {
    Match* match;
    int group;
    Indices at;
    int same;
  };
  // What the neighbours across the given sides are to take; false if one refuses.
  bool ask(uint32_t patch, int group, const Indices& at, std::span<const int> sides,
           std::vector<Pair>& pairs) const;
  static void take(const std::vector<Pair>& pairs);
  bool nominate(uint32_t patch);
  bool complete(uint32_t patch);

  std::span<const SkyPatch> patches_;
  const CorrespondenceOptions& options_;
  std::vector<std::unique_ptr<Match>> matches_;
  std::vector<std::array<std::vector<Side>, 3>> across_;  // of the side from colour k to k + 1
};

Selection::Selection(std::span<const SkyPolygons> skies, std::span<const SkyPatch> patches,
                     const CorrespondenceOptions& options)
    : patches_(patches), options_(options), matches_(patches.size()), across_(patches.size()) {
  parallel_for(patches.size(), options.threads, [&](size_t i) {
    matches_[i] = std::make_unique<Match>(skies, patches[i], options.single_loops);
  });
  std::map<std::pair<uint32_t, uint32_t>, std::vector<Side>> around;
  const auto ends = [&](uint32_t i, int k) {
    const auto& v = patches[i].vertices;
    return std::minmax(v[k], v[(k + 1) % 3]);
  };
  for (uint32_t i = 0; i < patches.size(); ++i) {
    for (int k = 0; k < 3; ++k) around[ends(i, k)].push_back({i, k, (k + 1) % 3});
  }
  for (uint32_t i = 0; i < patches.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      for (Side side : around[ends(i, k)]) {
        if (side.patch == i) continue;
        if (patches[side.patch].vertices[side.a] != patches[i].vertices[k]) {
          std::swap(side.a, side.b);
        }
        across_[i][k].push_back(side);
      }
    }
  }
}

bool Selection::ask(uint32_t patch, int group, const Indices& at, std::span<const int> sides,
                    std::vector<Pair>& pairs) const {
  const Match& own = *matches_[patch];
  for (const int k : sides) {
    const int l = (k + 1) % 3;
    const uint32_t a = own.corner(k, own.groups[group], at[k]);
    const uint32_t b = own.corner(l, own.groups[group], at[l]);
    for (const Side& side : across_[patch][k]) {
      Match& other = *matches_[side.patch];
      const Match::Place p = other.place(side.a, a), q = other.place(side.b, b);
      if (p.group < 0 || p.group != q.group) return false;
      Pair pair{&other, p.group, {-1, -1, -1}, -1};
      pair.at[side.a] = p.index, pair.at[side.b] = q.index;
      if (!other.groups[p.group].allows(pair.at, pair.same)) return false;
      pairs.push_back(pair);
    }
  }
  return true;
}

void Selection::take(const std::vector<Pair>& pairs) {
  for (const Pair& pair : pairs) {
    std::vector<Indices>& items = pair.match->groups[pair.group].items;
    if (pair.same < 0) {
      items.push_back(pair.at);
      continue;
    }
    for (int k = 0; k < 3; ++k) items[pair.same][k] = std::max(items[pair.same][k], pair.at[k]);
  }
}

// The best candidate that is left, if the rules allow it here and its pairs next door.
bool Selection::nominate(uint32_t patch) {
  Match& own = *matches_[patch];
  Pair pair{&own, 0, {}, -1};
  if (!own.next(pair.group, pair.at)) return false;
  if (!own.groups[pair.group].allows(pair.at, pair.same)) return true;
  std::vector<Pair> pairs{pair};
  constexpr int kAll[] = {0, 1, 2};
  if (ask(patch, pair.group, pair.at, kAll, pairs)) take(pairs);
  return true;
}

// Gives pairs a third corner, by the same rules. False if there is nothing to do.
bool Selection::complete(uint32_t patch) {
  Match& own = *matches_[patch];
  bool changed = false;
  for (int g = 0; g < static_cast<int>(own.groups.size()); ++g) {
    own.groups[g].drop_repeated();
    for (size_t i = 0; i < own.groups[g].items.size(); ++i) {
      const Group& group = own.groups[g];
      const Indices item = group.items[i];
      const auto unknown = std::find(item.begin(), item.end(), -1);
      if (unknown == item.end()) continue;
      const int k = static_cast<int>(unknown - item.begin());
      const int sides[] = {k, (k + 2) % 3};
      for (const uint32_t index : own.nearest(group, item, k)) {
        Pair full{&own, g, item, -1};
        full.at[k] = static_cast<int>(index);
        if (!group.allows(full.at, full.same)) continue;
        std::vector<Pair> pairs{full};
        if (!ask(patch, g, full.at, sides, pairs)) continue;
        take(pairs);
        changed = changed || full.same == static_cast<int>(i);
        break;
      }
    }
  }
  return changed;
}

std::vector<SkyTriples> Selection::run() {
  std::vector<uint32_t> order(patches_.size());
  std::iota(order.begin(), order.end(), 0);
  Rng rng(options_.seed, 7, 11);
  for (size_t i = order.size(); i > 1; --i) {
    std::swap(order[i - 1], order[static_cast<size_t>(rng.uniform() * static_cast<double>(i))]);
  }
  for (bool more = true; more;) {
    more = false;
    for (const uint32_t patch : order) more = nominate(patch) || more;
  }
  for (bool more = true; more;) {
    more = false;
    for (const uint32_t patch : order) more = complete(patch) || more;
  }
  std::vector<SkyTriples> result(patches_.size());
  parallel_for(result.size(), options_.threads,
               [&](size_t i) { result[i] = matches_[i]->finish(); });
  return result;
}

}  // namespace

std::vector<SkyTriples> find_correspondence(std::span<const SkyPolygons> skies,
                                            std::span<const SkyPatch> patches,
                                            const CorrespondenceOptions& options) {
  return Selection(skies, patches, options).run();
}

}  // namespace limn
