// Tubes, rods, lathes and ellipsoids as closed meshes, and the search for a number of faces.
#include "tools/generate/generate_parts.h"

#include <algorithm>
#include <cmath>

namespace limn {

void append(Triangles& mesh, const Triangles& part) {
  const uint32_t base = static_cast<uint32_t>(mesh.positions.size());
  mesh.positions.insert(mesh.positions.end(), part.positions.begin(), part.positions.end());
  for (const auto& [a, b, c] : part.faces) mesh.faces.push_back({base + a, base + b, base + c});
}

void add_quad(Triangles& mesh, uint32_t a, uint32_t b, uint32_t c, uint32_t d) {
  mesh.faces.push_back({a, b, c});
  mesh.faces.push_back({a, c, d});
}

Triangles with_faces(int faces, double first_h, const std::function<Triangles(double h)>& make) {
  Triangles best;
  double best_ratio = 0;
  double h = first_h;
  for (int attempt = 0; attempt < 10; ++attempt) {
    Triangles mesh = make(h);
    const double ratio = static_cast<double>(mesh.faces.size()) / faces;
    h *= std::sqrt(ratio);
    if (best.faces.empty() || std::fabs(std::log(ratio)) < std::fabs(std::log(best_ratio))) {
      best = std::move(mesh);
      best_ratio = ratio;
    }
    if (std::fabs(best_ratio - 1) < 0.05) break;
  }
  return best;
}

bool every_side_is_paired(const Triangles& mesh) {
  std::vector<std::pair<uint32_t, uint32_t>> sides;
  for (const FaceIndices& face : mesh.faces) {
    for (int i = 0; i < 3; ++i) sides.emplace_back(face[i], face[(i + 1) % 3]);
  }
  std::ranges::sort(sides);
  if (std::ranges::adjacent_find(sides) != sides.end()) return false;
  return std::ranges::all_of(sides, [&](const auto& side) {
    return std::ranges::binary_search(sides, std::pair(side.second, side.first));
  });
}

int steps(double length, double h, int fewest) {
  return std::max(fewest, static_cast<int>(std::lround(length / h)));
}

namespace {

// Unit vectors across the rings' axes, each the one before it turned as little as possible.
std::vector<Vec3d> transport(const std::vector<Ring>& rings) {
  std::vector<Vec3d> across;
  for (const Ring& ring : rings) {
    const Vec3d axis = normalize(ring.axis);
    const Vec3d last = across.empty() ? Frame(axis).s : across.back();
    across.push_back(normalize(last - axis * dot(last, axis)));
  }
  return across;
}

void add_ring(Triangles& mesh, const Ring& ring, const Vec3d& across, double angle, int sides) {
  if (ring.radius == 0) {
    mesh.positions.push_back(ring.center);
    return;
  }
  const Vec3d up = cross(normalize(ring.axis), across);
  for (int i = 0; i < sides; ++i) {
    const double a = angle + 2 * kPi * i / sides;
    mesh.positions.push_back(ring.center + (across * std::cos(a) + up * std::sin(a)) * ring.radius);
  }
}

// Faces between a ring whose vertices start at a and the next, at b.
void join_rings(Triangles& mesh, uint32_t a, bool a_is_point, uint32_t b, bool b_is_point,
                uint32_t sides) {
  for (uint32_t i = 0; i < sides; ++i) {
    const uint32_t j = (i + 1) % sides;
    if (a_is_point) {
      mesh.faces.push_back({a, b + j, b + i});
    } else if (b_is_point) {
      mesh.faces.push_back({a + i, a + j, b});
    } else {
      add_quad(mesh, a + i, a + j, b + j, b + i);
    }
  }
}

// A random number in [-1, 1] for a point of the lattice: the finalizer of SplitMix64 over its
// coordinates.
double lattice_number(int64_t x, int64_t y, int64_t z) {
  uint64_t bits = static_cast<uint64_t>(x) * 0x9e3779b97f4a7c15u +
                  static_cast<uint64_t>(y) * 0xc2b2ae3d27d4eb4fu +
                  static_cast<uint64_t>(z) * 0x165667b19e3779f9u;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9u;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111ebu;
  bits ^= bits >> 31;
  return static_cast<double>(bits >> 11) / static_cast<double>(uint64_t{1} << 52) - 1;
}

}  // namespace

Triangles sweep(const std::vector<Ring>& rings, int sides) {
  Triangles mesh;
  const std::vector<Vec3d> across = transport(rings);
  uint32_t last = 0;
  for (size_t i = 0; i < rings.size(); ++i) {
    const uint32_t start = static_cast<uint32_t>(mesh.positions.size());
    add_ring(mesh, rings[i], across[i], 0, sides);
    if (i > 0) {
      join_rings(mesh, last, rings[i - 1].radius == 0, start, rings[i].radius == 0,
                 static_cast<uint32_t>(sides));
    }
    last = start;
  }
  return mesh;
}

Triangles closed_sweep(const std::vector<Ring>& rings, int sides) {
  Triangles mesh;
  const std::vector<Vec3d> across = transport(rings);
  // What is left of a turn after one way round is spread over the rings.
  const Vec3d axis = normalize(rings[0].axis);
  const Vec3d back = normalize(across.back() - axis * dot(across.back(), axis));
  const double twist = std::atan2(dot(cross(back, across[0]), axis), dot(back, across[0]));
  const uint32_t count = static_cast<uint32_t>(rings.size());
  for (uint32_t i = 0; i < count; ++i) {
    add_ring(mesh, rings[i], across[i], twist * i / count, sides);
    const uint32_t n = static_cast<uint32_t>(sides);
    join_rings(mesh, i * n, false, (i + 1) % count * n, false, n);
  }
  return mesh;
}

double arc_length(const std::function<Vec3d(double)>& position) {
  constexpr int kPieces = 64;
  double sum = 0;
  for (int i = 0; i < kPieces; ++i) {
    sum += length(position((i + 1.0) / kPieces) - position(static_cast<double>(i) / kPieces));
  }
  return sum;
}

Triangles tube(const Tube& tube, double h) {
  const double radius = std::max({tube.radius(0), tube.radius(0.5), tube.radius(1)});
  const int sides = steps(2 * kPi * radius, h, 6);
  const int along = steps(arc_length(tube.position), h * tube.stretch, 4);
  const auto direction = [&](double t) {
    constexpr double kStep = 1e-4;
    return normalize(tube.position(std::min(1.0, t + kStep)) -
                     tube.position(std::max(0.0, t - kStep)));
  };
  std::vector<Ring> rings;
  const auto cap = [&](double t, double sign, int i, int count) {
    const double angle = kPi / 2 * i / count;
    const double r = tube.radius(t);
    rings.push_back({tube.position(t) + direction(t) * (sign * r * std::cos(angle)), direction(t),
                     i == 0 ? 0.0 : r * std::sin(angle)});
  };
  const int cap_steps = std::max(2, sides / 4);
  for (int i = 0; i < cap_steps; ++i) cap(0, -1, i, cap_steps);
  for (int i = 0; i <= along; ++i) {
    const double t = static_cast<double>(i) / along;
    rings.push_back({tube.position(t), direction(t), tube.radius(t)});
  }
  for (int i = cap_steps - 1; i >= 0; --i) cap(1, 1, i, cap_steps);
  return sweep(rings, sides);
}

Triangles rod(const Vec3d& from, const Vec3d& to, double radius, double h) {
  return tube(
      {[&](double t) { return from * (1 - t) + to * t; }, [&](double) { return radius; }, 4}, h);
}

Triangles lathe(const std::vector<std::pair<double, double>>& profile, double h) {
  double widest = 0;
  for (const auto& [r, y] : profile) widest = std::max(widest, r);
  const int sides = steps(2 * kPi * widest, h, 8);
  std::vector<Ring> rings;
  for (size_t i = 0; i + 1 < profile.size(); ++i) {
    const auto [r_0, y_0] = profile[i];
    const auto [r_1, y_1] = profile[i + 1];
    const int pieces = steps(std::hypot(r_1 - r_0, y_1 - y_0), h, 1);
    for (int k = 0; k < pieces; ++k) {
      const double t = static_cast<double>(k) / pieces;
      rings.push_back({{0, y_0 + t * (y_1 - y_0), 0}, {0, 1, 0}, r_0 + t * (r_1 - r_0)});
    }
  }
  rings.push_back({{0, profile.back().second, 0}, {0, 1, 0}, 0});
  return sweep(rings, sides);
}

Triangles smooth_lathe(const std::vector<std::pair<double, double>>& profile, double h, int sides) {
  std::vector<Vec3d> points;
  for (const auto& [r, y] : profile) points.push_back({r, y, 0});
  const double size = arc_length([&](double t) { return spline(points, t); });
  const int pieces = steps(size, h, 2 * static_cast<int>(points.size()));
  std::vector<Ring> rings = {{{0, profile.front().second, 0}, {0, 1, 0}, 0}};
  for (int i = 1; i < pieces; ++i) {
    const Vec3d p = spline(points, static_cast<double>(i) / pieces);
    rings.push_back({{0, p.y, 0}, {0, 1, 0}, p.x});
  }
  rings.push_back({{0, profile.back().second, 0}, {0, 1, 0}, 0});
  return sweep(rings, sides);
}

Triangles ellipsoid(const Vec3d& center, const Vec3d& radii, double h) {
  const double girth = 2 * kPi * std::max(radii.x, radii.z);
  const int sides = steps(girth, h, 6);
  const int rows = steps(kPi * std::max(radii.x, radii.y), h, 4);
  std::vector<Ring> rings;
  for (int i = 0; i <= rows; ++i) {
    const double angle = kPi * i / rows;
    const bool end = i == 0 || i == rows;
    rings.push_back({{0, -std::cos(angle), 0}, {0, 1, 0}, end ? 0.0 : std::sin(angle)});
  }
  Triangles mesh = sweep(rings, sides);
  for (Vec3d& p : mesh.positions) {
    p = center + Vec3d{p.x * radii.x, p.y * radii.y, p.z * radii.z};
  }
  return mesh;
}

Triangles torus(const Vec3d& center, const Vec3d& axis, double radius, double tube_radius,
                double h) {
  const Frame frame(normalize(axis));
  const int around = steps(2 * kPi * radius, h, 10);
  std::vector<Ring> rings;
  for (int i = 0; i < around; ++i) {
    const double a = 2 * kPi * i / around;
    rings.push_back({center + (frame.s * std::cos(a) + frame.t * std::sin(a)) * radius,
                     frame.t * std::cos(a) - frame.s * std::sin(a), tube_radius});
  }
  return closed_sweep(rings, steps(2 * kPi * tube_radius, h, 6));
}

double noise(const Vec3d& p) {
  const Vec3d cell{std::floor(p.x), std::floor(p.y), std::floor(p.z)};
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    double weight = 1;
    int64_t at[3];
    for (int k = 0; k < 3; ++k) {
      const double t = p[k] - cell[k];
      const double s = t * t * (3 - 2 * t);
      const int up = corner >> k & 1;
      weight *= up != 0 ? s : 1 - s;
      at[k] = static_cast<int64_t>(cell[k]) + up;
    }
    sum += weight * lattice_number(at[0], at[1], at[2]);
  }
  return sum;
}

Triangles moved(Triangles mesh, const Vec3d& offset) {
  for (Vec3d& p : mesh.positions) p += offset;
  return mesh;
}

Vec3d turned(const Vec3d& p, double angle) {
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * p.x + s * p.z, p.y, c * p.z - s * p.x};
}

Triangles turned(Triangles mesh, double angle) {
  for (Vec3d& p : mesh.positions) p = turned(p, angle);
  return mesh;
}

Vec3d spline(const std::vector<Vec3d>& points, double t) {
  const int last = static_cast<int>(points.size()) - 1;
  const double at = std::clamp(t, 0.0, 1.0) * last;
  const int i = std::min(static_cast<int>(at), last - 1);
  const double u = at - i;
  const Vec3d b = points[i];
  const Vec3d c = points[i + 1];
  // The curve leaves its ends straight towards the neighbours.
  const Vec3d a = i > 0 ? points[i - 1] : b * 2.0 - c;
  const Vec3d d = i + 2 <= last ? points[i + 2] : c * 2.0 - b;
  return b + (c - a) * (0.5 * u) + (a * 2.0 - b * 5.0 + c * 4.0 - d) * (0.5 * u * u) +
         (b * 3.0 - a - c * 3.0 + d) * (0.5 * u * u * u);
}

Triangles blade(int rows, int columns, const std::function<Vec3d(double s, double v)>& point) {
  Triangles mesh;
  mesh.positions.push_back(point(0, 0));
  for (int i = 1; i < rows; ++i) {
    for (int k = 0; k <= columns; ++k) {
      mesh.positions.push_back(point(static_cast<double>(i) / rows, 2.0 * k / columns - 1));
    }
  }
  mesh.positions.push_back(point(1, 0));
  const auto at = [&](int i, int k) {
    return static_cast<uint32_t>(1 + (i - 1) * (columns + 1) + k);
  };
  const auto tip = static_cast<uint32_t>(mesh.positions.size() - 1);
  for (int k = 0; k < columns; ++k) {
    mesh.faces.push_back({0, at(1, k), at(1, k + 1)});
    for (int i = 1; i + 1 < rows; ++i) {
      add_quad(mesh, at(i, k), at(i + 1, k), at(i + 1, k + 1), at(i, k + 1));
    }
    mesh.faces.push_back({at(rows - 1, k), tip, at(rows - 1, k + 1)});
  }
  return mesh;
}

}  // namespace limn
