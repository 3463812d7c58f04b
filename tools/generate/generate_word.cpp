// The word "limn", cut out of a board.
#include <array>
#include <cmath>
#include <map>
#include <string_view>

#include "tools/generate/generate_kinds.h"
#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

constexpr std::array<std::string_view, 6> kRows = {"#.#..........", "#............",
                                                   "#.#.#####.###", "#.#.#.#.#.#.#",
                                                   "#.#.#.#.#.#.#", "#.#.#.#.#.#.#"};
constexpr int kColumns = static_cast<int>(kRows[0].size());
using Cell = std::array<int, 3>;  // x to the right, y up, z towards the reader

// The surface of the cubes of side 1 / n that the letters are made of, a letter's stroke deep.
class Letters {
 public:
  explicit Letters(int n) : n_(n) {}

  Triangles surface() {
    for (int x = 0; x < kColumns * n_; ++x) {
      for (int y = 0; y < static_cast<int>(kRows.size()) * n_; ++y) {
        for (int z = 0; z < n_; ++z) {
          if (is_solid({x, y, z})) add_cube({x, y, z});
        }
      }
    }
    return std::move(mesh_);
  }

 private:
  bool is_solid(const Cell& c) const {
    const int rows = static_cast<int>(kRows.size());
    if (c[0] < 0 || c[1] < 0 || c[2] < 0) return false;
    const int column = c[0] / n_, row = rows - 1 - c[1] / n_;
    return column < kColumns && row >= 0 && c[2] < n_ && kRows[row][column] == '#';
  }
  // The sides of a cube that no other covers.
  void add_cube(const Cell& c) {
    for (int axis = 0; axis < 3; ++axis) {
      for (const int side : {0, 1}) {
        Cell beside = c;
        beside[axis] += side == 1 ? 1 : -1;
        if (is_solid(beside)) continue;
        const int u = (axis + 1) % 3, v = (axis + 2) % 3;
        std::array<uint32_t, 4> corners;
        for (int i = 0; i < 4; ++i) {
          Cell corner = c;
          corner[axis] += side;
          corner[u] += i == 1 || i == 2;
          corner[v] += i >= 2;
          corners[i] = vertex(corner);
        }
        if (side == 0) std::swap(corners[1], corners[3]);
        add_quad(mesh_, corners[0], corners[1], corners[2], corners[3]);
      }
    }
  }
  uint32_t vertex(const Cell& c) {
    const auto [entry, is_new] =
        vertices_.try_emplace(c, static_cast<uint32_t>(mesh_.positions.size()));
    if (is_new) mesh_.positions.push_back(Vec3d{1.0 * c[0], 1.0 * c[1], 1.0 * c[2]} * (1.0 / n_));
    return entry->second;
  }

  int n_;
  Triangles mesh_;
  std::map<Cell, uint32_t> vertices_;
};

}  // namespace

Triangles make_word(int faces) {
  return with_faces(faces, 16 / std::sqrt(faces),
                    [](double h) { return Letters(steps(1, h, 1)).surface(); });
}

}  // namespace limn
