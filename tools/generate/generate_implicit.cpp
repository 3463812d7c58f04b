// Surfaces of functions by surface nets, spread evenly and cut into triangles.
#include "tools/generate/generate_implicit.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "tools/generate/generate_parts.h"

namespace limn {
namespace {

using Quad = std::array<uint32_t, 4>;

// Values on the corners of a box of cubes, cut into what the surface passes.
class Grid {
 public:
  Grid(const Implicit& surface, double h) : surface_(surface), h_(h) {
    for (int axis = 0; axis < 3; ++axis) {
      size_[axis] =
          static_cast<int>(std::ceil((surface.upper[axis] - surface.lower[axis]) / h)) + 1;
    }
    values_.resize(static_cast<size_t>(size_[0]) * size_[1] * size_[2]);
    for_each_corner([&](const std::array<int, 3>& c) {
      values_[index(c)] = static_cast<float>(surface_.value(position(c)));
    });
  }

  // A vertex in every cube that has corners on both sides.
  void place_vertices(std::vector<Vec3d>& positions) {
    vertices_.assign(values_.size(), kNone);
    for_each_corner([&](const std::array<int, 3>& c) {
      if (c[0] + 1 >= size_[0] || c[1] + 1 >= size_[1] || c[2] + 1 >= size_[2]) return;
      Vec3d sum;
      int crossings = 0;
      for (int axis = 0; axis < 3; ++axis) {
        for (int k = 0; k < 4; ++k) {
          std::array<int, 3> from = c;
          from[(axis + 1) % 3] += k & 1;
          from[(axis + 2) % 3] += k >> 1;
          add_crossing(from, axis, sum, crossings);
        }
      }
      if (crossings == 0) return;
      vertices_[index(c)] = static_cast<uint32_t>(positions.size());
      positions.push_back(sum / static_cast<double>(crossings));
    });
  }

  void place_quads(std::vector<Quad>& quads) const {
    for_each_corner([&](const std::array<int, 3>& c) {
      for (int axis = 0; axis < 3; ++axis) {
        const int u = (axis + 1) % 3;
        const int v = (axis + 2) % 3;
        if (c[axis] + 1 >= size_[axis] || c[u] == 0 || c[v] == 0) continue;
        std::array<int, 3> next = c;
        ++next[axis];
        const bool inside = values_[index(c)] < 0;
        if (inside == (values_[index(next)] < 0)) continue;
        const auto cube = [&](int du, int dv) {
          std::array<int, 3> at = c;
          at[u] -= du;
          at[v] -= dv;
          return vertices_[index(at)];
        };
        Quad quad = {cube(1, 1), cube(0, 1), cube(0, 0), cube(1, 0)};
        if (!inside) std::swap(quad[1], quad[3]);
        quads.push_back(quad);
      }
    });
  }

 private:
  static constexpr uint32_t kNone = UINT32_MAX;

  template <class F>
  void for_each_corner(const F& f) const {
    for (int z = 0; z < size_[2]; ++z) {
      for (int y = 0; y < size_[1]; ++y) {
        for (int x = 0; x < size_[0]; ++x) f({x, y, z});
      }
    }
  }
  size_t index(const std::array<int, 3>& c) const {
    return (static_cast<size_t>(c[2]) * size_[1] + c[1]) * size_[0] + c[0];
  }
  Vec3d position(const std::array<int, 3>& c) const {
    return surface_.lower + Vec3d{c[0] * h_, c[1] * h_, c[2] * h_};
  }
  void add_crossing(const std::array<int, 3>& from, int axis, Vec3d& sum, int& count) const {
    std::array<int, 3> to = from;
    ++to[axis];
    const double a = values_[index(from)];
    const double b = values_[index(to)];
    if ((a < 0) == (b < 0)) return;
    sum += position(from) + (position(to) - position(from)) * (a / (a - b));
    ++count;
  }

  const Implicit& surface_;
  double h_;
  std::array<int, 3> size_;
  std::vector<float> values_;       // at corners
  std::vector<uint32_t> vertices_;  // of the cube above each corner
};

// One Newton step along the gradient (central differences over `step`).
Vec3d towards_surface(const Implicit& surface, const Vec3d& p, double step) {
  Vec3d gradient;
  for (int axis = 0; axis < 3; ++axis) {
    Vec3d d;
    d[axis] = step;
    gradient[axis] = (surface.value(p + d) - surface.value(p - d)) / (2 * step);
  }
  const double square = length_squared(gradient);
  return square > 0 ? p - gradient * (surface.value(p) / square) : p;
}

// Every vertex halfway to the mean of its neighbours, then back to the surface.
void spread(const Implicit& surface, double h, const std::vector<Quad>& quads,
            std::vector<Vec3d>& positions) {
  std::vector<Vec3d> sums(positions.size());
  std::vector<int> counts(positions.size());
  for (const Quad& quad : quads) {
    for (int k = 0; k < 4; ++k) {
      sums[quad[k]] += positions[quad[(k + 1) % 4]] + positions[quad[(k + 3) % 4]];
      counts[quad[k]] += 2;
    }
  }
  for (size_t i = 0; i < positions.size(); ++i) {
    const Vec3d p = (positions[i] + sums[i] / static_cast<double>(counts[i])) * 0.5;
    positions[i] = towards_surface(surface, p, 0.01 * h);
  }
}

}  // namespace

Triangles polygonise(const Implicit& surface, double h) {
  Triangles mesh;
  std::vector<Quad> quads;
  {
    Grid grid(surface, h);
    grid.place_vertices(mesh.positions);
    grid.place_quads(quads);
  }
  constexpr int kRounds = 10;
  for (int round = 0; round < kRounds; ++round) spread(surface, h, quads, mesh.positions);
  for (const auto& [a, b, c, d] : quads) {
    const auto& p = mesh.positions;
    if (length_squared(p[a] - p[c]) <= length_squared(p[b] - p[d])) {
      add_quad(mesh, a, b, c, d);
    } else {
      mesh.faces.push_back({a, b, d});
      mesh.faces.push_back({b, c, d});
    }
  }
  return mesh;
}

double Bone::distance(const Vec3d& p) const {
  const Vec3d along = b - a;
  const double t = std::clamp(dot(p - a, along) / length_squared(along), 0.0, 1.0);
  return length(p - a - along * t) - (r_a + t * (r_b - r_a));
}

double blend(const std::vector<Bone>& bones, double width, const Vec3d& p) {
  // Sum of exp((nearest - distance) / width), rescaled whenever a nearer bone turns up.
  double nearest = bones.front().distance(p);
  double sum = 1;
  for (const Bone& bone : std::span(bones).subspan(1)) {
    const double distance = bone.distance(p);
    if (distance < nearest) {
      sum = 1 + sum * std::exp((distance - nearest) / width);
      nearest = distance;
    } else {
      sum += std::exp((nearest - distance) / width);
    }
  }
  return nearest - width * std::log(sum);
}

}  // namespace limn
