// Welds vertices along open seams whose positions differ by rounding.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {
namespace {

uint64_t mixed(uint64_t x) {
  x ^= x >> 33;
  x *= 0xff51afd7ed558ccdull;
  x ^= x >> 33;
  x *= 0xc4ceb9fe1a85ec53ull;
  return x ^ x >> 33;
}

// Vertices (first copies) at which some side of a face has no opposite side. Opposite sides cancel
// in a sum of random numbers, one per edge, which avoids sorting.
std::vector<uint32_t> open_vertices(const Mesh& mesh) {
  std::vector<uint64_t> sums(mesh.positions.size());
  for (const FaceIndices& face : mesh.faces) {
    for (int k = 0; k < 3; ++k) {
      const uint64_t a = mesh.weld[face[k]], b = mesh.weld[face[(k + 1) % 3]];
      const uint64_t number = mixed(std::min(a, b) << 32 | std::max(a, b));
      sums[a] += a < b ? number : -number;
      sums[b] += a < b ? number : -number;
    }
  }
  std::vector<uint32_t> open;
  for (uint32_t v = 0; v < sums.size(); ++v)
    if (sums[v] != 0) open.push_back(v);
  return open;
}

// Sets of open vertices that are equal up to the rounding of their positions.
class SeamWelder {
 public:
  explicit SeamWelder(Mesh& mesh) : mesh_(mesh), open_(open_vertices(mesh)) {}

  void weld() {
    if (open_.empty()) return;
    measure();
    roots_.resize(mesh_.positions.size());
    std::iota(roots_.begin(), roots_.end(), 0u);
    std::vector<int> levels;
    for (const uint32_t v : open_) levels.push_back(level(v));
    std::sort(levels.begin(), levels.end());
    levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
    for (const int l : levels) join_neighbours(l);
    dissolve_small_faces();
    for (uint32_t& w : mesh_.weld) w = root(w);
  }

 private:
  using Cell = std::array<int64_t, 3>;

  // The rounding error of a position: it is rounded to float twice (in the file, and after its
  // transform), by half a unit in the last place of the face's largest coordinate each time; at
  // most sqrt(3) 2^-23 of that coordinate.
  void measure() {
    tolerances_.assign(mesh_.positions.size(), 0);
    for (const FaceIndices& face : mesh_.faces) {
      float size = 0;
      for (const uint32_t v : face)
        for (int k = 0; k < 3; ++k) size = std::max(size, std::fabs(mesh_.positions[v][k]));
      for (const uint32_t v : face) {
        double& tolerance = tolerances_[mesh_.weld[v]];
        tolerance = std::max(tolerance, 0x1.0p-22 * size);
      }
    }
  }

  // Grid level of a vertex: cells of size 2^level are at least as large as the distance at which it
  // welds to vertices of its level or below.
  int level(uint32_t v) const { return std::ilogb(tolerances_[v]) + 2; }

  Cell cell(uint32_t v, int level) const {
    Cell cell;
    for (int k = 0; k < 3; ++k)
      cell[k] = static_cast<int64_t>(
          std::floor(std::ldexp(static_cast<double>(mesh_.positions[v][k]), -level)));
    return cell;
  }

  // Joins vertices of this level with those of the same or lower levels.
  void join_neighbours(int l) {
    std::vector<std::pair<Cell, uint32_t>> places;
    for (const uint32_t v : open_)
      if (level(v) <= l) places.push_back({cell(v, l), v});
    std::sort(places.begin(), places.end());
    for (const uint32_t u : open_) {
      if (level(u) != l) continue;
      const Cell center = cell(u, l);
      for (int dx = -1; dx <= 1; ++dx)
        for (int dy = -1; dy <= 1; ++dy) {
          // Cells of a row are consecutive.
          const Cell row{center[0] + dx, center[1] + dy, center[2] - 1};
          for (auto i = std::lower_bound(places.begin(), places.end(), std::pair(row, 0u));
               i != places.end() && i->first[0] == row[0] && i->first[1] == row[1] &&
               i->first[2] <= center[2] + 1;
               ++i) {
            join_if_near(u, i->second);
          }
        }
    }
  }

  double distance(uint32_t u, uint32_t v) const {
    return length(cast<double>(mesh_.positions[u]) - cast<double>(mesh_.positions[v]));
  }

  void join_if_near(uint32_t u, uint32_t v) {
    if (distance(u, v) > tolerances_[u] + tolerances_[v]) return;
    const uint32_t a = root(u), b = root(v);
    roots_[std::max(a, b)] = std::min(a, b);
  }

  uint32_t root(uint32_t v) const {
    while (roots_[v] != v) v = roots_[v];
    return v;
  }

  // A collapsing face is a sliver between copies of a pole, and its neighbours connect without it.
  // Otherwise its faces are as small as the rounding, and their corners stay apart.
  void dissolve_small_faces() {
    std::map<Side, bool> long_sides;  // long sides of slivers: whether they have another face
    std::vector<std::pair<Side, uint32_t>> needles;
    std::vector<bool> small(mesh_.positions.size());
    for (const FaceIndices& face : mesh_.faces)
      for (int k = 0; k < 3; ++k) {
        const uint32_t a = mesh_.weld[face[k]], b = mesh_.weld[face[(k + 1) % 3]];
        if (a == b || root(a) != root(b)) continue;
        const uint32_t tip = mesh_.weld[face[(k + 2) % 3]];
        constexpr double kSharp = 1024;  // length / width; not tuned
        if (distance(a, tip) <= kSharp * (tolerances_[a] + tolerances_[b])) small[root(a)] = true;
        needles.push_back({side(a, tip), root(a)});
        long_sides[side(a, tip)] = false;
      }
    if (needles.empty()) return;
    for (const FaceIndices& face : mesh_.faces) {
      const uint32_t a = root_of_corner(face, 0), b = root_of_corner(face, 1),
                     c = root_of_corner(face, 2);
      if (a == b || b == c || c == a) continue;
      for (const Side& s : {side(a, b), side(b, c), side(c, a)})
        if (const auto found = long_sides.find(s); found != long_sides.end()) found->second = true;
    }
    for (const auto& [s, set] : needles)
      if (!long_sides[s]) small[set] = true;
    std::vector<uint32_t> apart;
    for (const uint32_t v : open_)
      if (small[root(v)]) apart.push_back(v);
    for (const uint32_t v : apart) roots_[v] = v;
  }

  using Side = std::pair<uint32_t, uint32_t>;
  Side side(uint32_t u, uint32_t v) const { return std::minmax({root(u), root(v)}); }
  uint32_t root_of_corner(const FaceIndices& face, int k) const {
    return root(mesh_.weld[face[k]]);
  }

  Mesh& mesh_;
  std::vector<uint32_t> open_;
  std::vector<double> tolerances_;  // V
  std::vector<uint32_t> roots_;     // V; union-find parents, with the smallest index as root
};

}  // namespace

void weld_seams(Mesh& mesh) { SeamWelder(mesh).weld(); }

}  // namespace limn
