// Meshes made by formula.
#include "meshes.h"

#include <cmath>
#include <map>
#include <utility>

namespace limn {
namespace {

void weld(Mesh& mesh) {
  std::map<std::array<float, 3>, uint32_t> first;
  mesh.weld.resize(mesh.positions.size());
  for (uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3f& x = mesh.positions[v];
    mesh.weld[v] = first.emplace(std::array{x.x + 0.0f, x.y + 0.0f, x.z + 0.0f}, v).first->second;
  }
}

}  // namespace

Mesh make_mesh(SharedVector<Vec3f> positions, SharedVector<FaceIndices> faces) {
  Mesh mesh;
  mesh.positions = std::move(positions);
  mesh.faces = std::move(faces);
  weld(mesh);
  return mesh;
}

Mesh tetrahedron_mesh() {
  return make_mesh({{1, 1, 1}, {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}},
                   {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}});
}

Mesh cube_mesh() {
  std::vector<Vec3f> x;
  for (int i = 0; i < 8; ++i)
    x.push_back({i & 1 ? 1.f : -1.f, i & 2 ? 1.f : -1.f, i & 4 ? 1.f : -1.f});
  std::vector<FaceIndices> faces;
  const std::array<uint32_t, 4> quads[] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                           {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  for (const auto& q : quads) {
    faces.push_back({q[0], q[1], q[2]});
    faces.push_back({q[0], q[2], q[3]});
  }
  return make_mesh(x, faces);
}

Mesh icosphere_mesh(int levels) {
  const double g = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vec3d> x{{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                       {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  std::vector<FaceIndices> faces{{0, 11, 5}, {0, 5, 1},  {0, 1, 7},   {0, 7, 10}, {0, 10, 11},
                                 {1, 5, 9},  {5, 11, 4}, {11, 10, 2}, {10, 7, 6}, {7, 1, 8},
                                 {3, 9, 4},  {3, 4, 2},  {3, 2, 6},   {3, 6, 8},  {3, 8, 9},
                                 {4, 9, 5},  {2, 4, 11}, {6, 2, 10},  {8, 6, 7},  {9, 8, 1}};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
    const auto middle = [&](uint32_t a, uint32_t b) {
      const auto [found, is_new] =
          middles.emplace(std::minmax(a, b), static_cast<uint32_t>(x.size()));
      if (is_new) x.push_back((normalize(x[a]) + normalize(x[b])) * 0.5);
      return found->second;
    };
    std::vector<FaceIndices> finer;
    for (const auto& [a, b, c] : faces) {
      const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {b, bc, ab}, {c, ca, bc}, {ab, bc, ca}});
    }
    faces = finer;
  }
  std::vector<Vec3f> positions;
  for (const Vec3d& v : x) positions.push_back(cast<float>(normalize(v)));
  return make_mesh(positions, faces);
}

Mesh torus_mesh(int around, int tube) {
  std::vector<Vec3f> x;
  std::vector<FaceIndices> faces;
  const auto id = [&](int i, int j) {
    return static_cast<uint32_t>((i % around) * tube + j % tube);
  };
  for (int i = 0; i < around; ++i) {
    for (int j = 0; j < tube; ++j) {
      const double u = 2 * kPi * i / around, v = 2 * kPi * j / tube, r = 1 + 0.4 * std::cos(v);
      x.push_back(cast<float>(Vec3d{r * std::cos(u), r * std::sin(u), 0.4 * std::sin(v)}));
      faces.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      faces.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  }
  return make_mesh(x, faces);
}

Mesh grid_mesh(int cells) {
  std::vector<Vec3f> x;
  std::vector<FaceIndices> faces;
  const float step = 2.0f / static_cast<float>(cells);
  for (int j = 0; j <= cells; ++j)
    for (int i = 0; i <= cells; ++i)
      x.push_back({static_cast<float>(i) * step - 1, static_cast<float>(j) * step - 1, 0});
  const auto id = [&](int i, int j) { return static_cast<uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      faces.push_back({id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      faces.push_back({id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  }
  return make_mesh(x, faces);
}

Mesh rod_mesh(int sides, double radius) {
  std::vector<Vec3f> x;
  std::vector<FaceIndices> faces;
  for (int i = 0; i < sides; ++i) {
    const double angle = 2 * kPi * i / sides;
    for (const double z : {-1, 1})
      x.push_back(cast<float>(Vec3d{radius * std::cos(angle), radius * std::sin(angle), z}));
    const auto a = static_cast<uint32_t>(2 * i), b = static_cast<uint32_t>(2 * ((i + 1) % sides));
    faces.insert(faces.end(), {{a, b, b + 1}, {a, b + 1, a + 1}});
  }
  return make_mesh(x, faces);
}

Mesh cap_mesh(int levels) {
  const Mesh sphere = icosphere_mesh(levels);
  std::vector<FaceIndices> faces;
  for (const auto& [a, b, c] : sphere.faces)
    if (sphere.positions[a].z + sphere.positions[b].z + sphere.positions[c].z > 0)
      faces.push_back({a, b, c});
  return make_mesh(sphere.positions, faces);
}

Mesh seam_split(const Mesh& mesh) {
  Mesh split = mesh;
  split.positions.clear();
  split.position_tangents.clear();
  for (FaceIndices& face : split.faces) {
    for (uint32_t& v : face) {
      split.positions.push_back(mesh.positions[v]);
      if (!mesh.position_tangents.empty())
        split.position_tangents.push_back(mesh.position_tangents[v]);
      v = static_cast<uint32_t>(split.positions.size() - 1);
    }
  }
  weld(split);
  return split;
}

Mesh reversed(Mesh mesh) {
  for (FaceIndices& face : mesh.faces) std::swap(face[1], face[2]);
  for (FaceIndices& face : mesh.normal_ids) std::swap(face[1], face[2]);
  for (Vec3d& n : mesh.normals) n = -n;
  return mesh;
}

Mesh joined(const Mesh& a, const Mesh& b) {
  std::vector<Vec3f> x(a.positions);
  std::vector<FaceIndices> faces(a.faces);
  const auto offset = static_cast<uint32_t>(x.size());
  x.insert(x.end(), b.positions.begin(), b.positions.end());
  for (const auto& [i, j, k] : b.faces) faces.push_back({i + offset, j + offset, k + offset});
  return make_mesh(x, faces);
}

Mesh with_smooth_normals(Mesh mesh) {
  mesh.normal_source = NormalSource::kGiven;
  mesh.normals.assign(mesh.positions.size(), {});
  mesh.normal_ids = mesh.faces;
  for (FaceIndices& face : mesh.normal_ids) {
    const Vec3d a = cast<double>(mesh.positions[face[0]]);
    const Vec3d n =
        cross(cast<double>(mesh.positions[face[1]]) - a, cast<double>(mesh.positions[face[2]]) - a);
    for (uint32_t& v : face) mesh.normals[v = mesh.weld[v]] += n;
  }
  for (Vec3d& n : mesh.normals)
    if (length(n) > 0) n = normalize(n);
  return mesh;
}

Mesh transformed(const Mesh& mesh, const Vec3d (&rows)[3], double scale, const Vec3d& offset) {
  Mesh moved = mesh;
  const auto turn = [&](const Vec3d& x) {
    return Vec3d{dot(rows[0], x), dot(rows[1], x), dot(rows[2], x)};
  };
  for (Vec3f& x : moved.positions) x = cast<float>(turn(cast<double>(x)) * scale + offset);
  for (Vec3d& n : moved.normals) n = turn(n);
  weld(moved);
  return moved;
}

void random_rotation(Rng& rng, Vec3d (&rows)[3]) {
  const Vec3d n = random_direction(rng);
  const Vec3d s = normalize(cross(n, random_direction(rng)));
  rows[0] = s;
  rows[1] = cross(n, s);
  rows[2] = n;
}

void set_test_tangents(Mesh& mesh) {
  mesh.position_tangents.clear();
  for (uint32_t v = 0; v < mesh.positions.size(); ++v) {
    const Vec3d x = cast<double>(mesh.positions[v]);
    const double own = std::sin(1.0 + mesh.weld[v]);
    mesh.position_tangents.push_back(
        {Lanes{1, -x.y, own, 0}, Lanes{0, x.x, own * own, 0}, Lanes{0, 0, 1 - own, 0}});
  }
}

std::vector<NamedMesh> test_meshes() {
  std::vector<NamedMesh> meshes{
      {"tetrahedron", tetrahedron_mesh()},
      {"cube", cube_mesh()},
      {"split cube", seam_split(cube_mesh())},
      {"smooth cube", with_smooth_normals(cube_mesh())},
      {"sphere", icosphere_mesh(2)},
      {"smooth sphere", with_smooth_normals(icosphere_mesh(2))},
      {"smooth split sphere", with_smooth_normals(seam_split(icosphere_mesh(2)))},
      {"smooth torus", with_smooth_normals(torus_mesh(24, 12))},
      {"grid", grid_mesh(5)},
      {"smooth cap", with_smooth_normals(cap_mesh(2))},
  };
  for (NamedMesh& named : meshes) set_test_tangents(named.mesh);
  return meshes;
}

}  // namespace limn
