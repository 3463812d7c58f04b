// Mitsuba's built-in shapes as triangle meshes.
#include <array>
#include <cmath>
#include <map>

#include "src/mesh/shapes.h"

namespace limn {

namespace {

// Number of sides of the polygon of a disk or cylinder: its area is 1e-4 below the disk's.
constexpr uint32_t kSides = 256;
// Number of subdivisions of the icosahedron: 5120 faces, up to 1.2e-3 radii inside the
// sphere.
constexpr int kSphereSplits = 4;

// A triangulated sphere whose vertices equal their normals.
struct SphereBuilder {
  std::vector<Vec3d> points;
  std::vector<FaceIndices> faces;
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> midpoints;

  uint32_t midpoint(uint32_t a, uint32_t b) {
    const auto [entry, is_new] =
        midpoints.try_emplace(std::minmax(a, b), static_cast<uint32_t>(points.size()));
    if (is_new) points.push_back(normalize(points[a] + points[b]));
    return entry->second;
  }

  void split() {
    std::vector<FaceIndices> finer;
    for (const FaceIndices& f : faces) {
      const uint32_t a = midpoint(f[0], f[1]);
      const uint32_t b = midpoint(f[1], f[2]);
      const uint32_t c = midpoint(f[2], f[0]);
      finer.insert(finer.end(), {{f[0], a, c}, {a, f[1], b}, {c, b, f[2]}, {a, b, c}});
    }
    faces = std::move(finer);
  }
};

// Corners (0, +-1, +-g) and their cyclic shifts; a face is every triple of mutual neighbours.
SphereBuilder icosahedron() {
  SphereBuilder sphere;
  const double g = (1 + std::sqrt(5.0)) / 2;
  for (int axis = 0; axis < 3; ++axis) {
    for (int sign = 0; sign < 4; ++sign) {
      Vec3d p;
      p[(axis + 1) % 3] = sign & 1 ? -1 : 1;
      p[(axis + 2) % 3] = sign & 2 ? -g : g;
      sphere.points.push_back(p);
    }
  }
  const auto neighbours = [&](uint32_t a, uint32_t b) {
    return length_squared(sphere.points[a] - sphere.points[b]) < 5;  // edges have length 2
  };
  for (uint32_t a = 0; a < 12; ++a) {
    for (uint32_t b = a + 1; b < 12; ++b) {
      for (uint32_t c = b + 1; c < 12; ++c) {
        if (!neighbours(a, b) || !neighbours(b, c) || !neighbours(a, c)) continue;
        const auto& p = sphere.points;
        const bool outward = determinant(p[a], p[b], p[c]) > 0;
        sphere.faces.push_back(outward ? FaceIndices{a, b, c} : FaceIndices{a, c, b});
      }
    }
  }
  for (Vec3d& p : sphere.points) p = normalize(p);
  return sphere;
}

// Texture coordinates that follow from where a point lies in the shape.
void add_places(UvSource source, RawMesh& raw) {
  raw.uv_source = source;
  for (const Vec3d& p : raw.positions) raw.uv_places.push_back(cast<float>(p));
  raw.uv_ids = raw.faces;
}

}  // namespace

RawMesh make_rectangle() {
  RawMesh raw{{}, {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, {{0, 1, 2}, {0, 2, 3}}, {}, {}};
  raw.uv_source = UvSource::kPlane;
  raw.uv_places = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  raw.uv_ids = raw.faces;
  return raw;
}

// Vertex i has the coordinate +1 where bit k of i is set.
RawMesh make_cube() {
  RawMesh cube{{}, {}, {}, {}, {}};
  for (int i = 0; i < 8; ++i) {
    cube.positions.push_back({i & 1 ? 1. : -1., i & 2 ? 1. : -1., i & 4 ? 1. : -1.});
  }
  // Its corners, and where u and v grow: axis 0 to 2, or ~axis against it.
  struct Side {
    std::array<uint32_t, 4> corners;
    int u, v;
  };
  const Side sides[6] = {{{0, 4, 6, 2}, 1, 2},   {{1, 3, 7, 5}, 1, ~2}, {{0, 1, 5, 4}, 2, 0},
                         {{2, 6, 7, 3}, ~0, ~2}, {{0, 2, 3, 1}, ~1, 0}, {{4, 5, 7, 6}, 1, 0}};
  cube.uv_source = UvSource::kPlane;
  for (const Side& s : sides) {
    const auto first = static_cast<uint32_t>(cube.uv_places.size());
    for (const uint32_t corner : s.corners) {
      const auto along = [&](int axis) {
        return axis >= 0 ? static_cast<float>(corner >> axis & 1)
                         : 1 - static_cast<float>(corner >> ~axis & 1);
      };
      cube.uv_places.push_back({along(s.u), along(s.v), 0});
    }
    for (const uint32_t k : {1, 2}) {
      cube.faces.push_back({s.corners[0], s.corners[k], s.corners[k + 1]});
      cube.uv_ids.push_back({first, first + k, first + k + 1});
    }
  }
  return cube;
}

RawMesh make_disk() {
  RawMesh disk{{}, {{0, 0, 0}}, {}, {}, {}};
  for (uint32_t i = 0; i < kSides; ++i) {
    const double angle = 2 * kPi * i / kSides;
    disk.positions.push_back({std::cos(angle), std::sin(angle), 0});
    disk.faces.push_back({0, i + 1, (i + 1) % kSides + 1});
  }
  add_places(UvSource::kDisk, disk);
  return disk;
}

RawMesh make_sphere() {
  SphereBuilder sphere = icosahedron();
  for (int i = 0; i < kSphereSplits; ++i) sphere.split();
  RawMesh raw{{}, sphere.points, sphere.faces, sphere.points, sphere.faces};
  add_places(UvSource::kSphere, raw);
  return raw;
}

RawMesh make_cylinder() {
  RawMesh cylinder{{}, {}, {}, {}, {}};
  cylinder.uv_source = UvSource::kPlane;
  for (uint32_t i = 0; i <= kSides; ++i) {
    const float turn = static_cast<float>(i) / kSides;
    cylinder.uv_places.insert(cylinder.uv_places.end(), {{turn, 0, 0}, {turn, 1, 0}});
  }
  for (uint32_t i = 0; i < kSides; ++i) {
    const double angle = 2 * kPi * i / kSides;
    const Vec3d outward{std::cos(angle), std::sin(angle), 0};
    cylinder.normals.push_back(outward);
    cylinder.positions.push_back(outward);
    cylinder.positions.push_back(outward + Vec3d{0, 0, 1});
    const uint32_t next = (i + 1) % kSides;
    cylinder.faces.push_back({2 * i, 2 * next, 2 * next + 1});
    cylinder.normal_ids.push_back({i, next, next});
    cylinder.uv_ids.push_back({2 * i, 2 * i + 2, 2 * i + 3});
    cylinder.faces.push_back({2 * i, 2 * next + 1, 2 * i + 1});
    cylinder.normal_ids.push_back({i, next, i});
    cylinder.uv_ids.push_back({2 * i, 2 * i + 3, 2 * i + 1});
  }
  return cylinder;
}

}  // namespace limn
