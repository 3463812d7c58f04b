// Meshes and points that are hard for trees that reject.
#include "hard_meshes.h"

#include <cmath>

namespace limn {
namespace {

// Ugly ones beside the well-behaved.
Mesh needle_mesh() {
  Mesh mesh = with_smooth_normals(icosphere_mesh(2));
  for (Vec3f& x : mesh.positions) x = {x.x * 1e-4f, x.y, x.z * 1e-2f};
  weld_positions(mesh);
  return with_smooth_normals(mesh);
}

Mesh doubled_mesh() {
  Mesh mesh = icosphere_mesh(1);
  const std::vector<FaceIndices> faces(mesh.faces);
  for (size_t f = 0; f < faces.size(); f += 3) mesh.faces.push_back(faces[f]);
  for (size_t f = 0; f < faces.size(); f += 5)
    mesh.faces.push_back({faces[f][0], faces[f][2], faces[f][1]});
  return with_smooth_normals(mesh);
}

Mesh displaced(Mesh mesh, double size, Rng& rng) {
  for (Vec3f& x : mesh.positions) x = x + cast<float>(random_direction(rng) * size);
  weld_positions(mesh);
  return with_smooth_normals(mesh);
}

}  // namespace

std::vector<NamedMesh> meshes_of_all_kinds(Rng& rng) {
  std::vector<NamedMesh> meshes = test_meshes();
  meshes.push_back({"needles", needle_mesh()});
  meshes.push_back({"flat patch", with_smooth_normals(grid_mesh(6))});
  meshes.push_back({"duplicate faces", doubled_mesh()});
  meshes.push_back({"crumpled sphere", displaced(icosphere_mesh(2), 0.2, rng)});
  meshes.push_back({"shaken torus", displaced(torus_mesh(20, 10), 1e-3, rng)});
  meshes.push_back({"shaken grid", displaced(grid_mesh(6), 1e-6, rng)});
  return meshes;
}

PlacedMeshes placed_twice(const Mesh& mesh, int i, Rng& rng) {
  Vec3d rows[3];
  random_rotation(rng, rows);
  const double scale = random_scale(rng), shift = i % 2 == 0 ? 0 : 1e4 * rng.uniform();
  const Mesh moved = transformed(mesh, rows, scale, random_direction(rng) * shift);
  const Mesh other = transformed(mesh, rows, 0.1 * scale, {});
  return {{{build_edge_mesh(moved, i % 3 != 0), build_edge_mesh(other, true, ShapeId(1))}}, scale};
}

double random_scale(Rng& rng) { return std::exp(std::log(1e-3) + std::log(1e7) * rng.uniform()); }

Vec3d random_point(const EdgeMesh& mesh, double scale, Rng& rng) {
  // Far away, rounding leaves some meshes no edge.
  if (mesh.edges.empty()) return random_direction(rng) * scale;
  const Edge& edge = mesh.edges[static_cast<size_t>(rng.uniform() * mesh.edges.size())];
  const Vec3d a = mesh.position(edge.vertices[0]), b = mesh.position(edge.vertices[1]);
  const Plane& plane = mesh.plane(edge.faces[0]);
  const double kind = rng.uniform(), u = rng.uniform();
  if (kind < 0.1) return a;
  if (kind < 0.2) return a * (1 - u) + b * u;
  const Vec3d direction = random_direction(rng);
  const double far = std::exp(std::log(1e6) * u);
  const Vec3d x = a + direction * (scale * (kind < 0.6 ? far : 2 * u));
  if (kind < 0.3 || kind > 0.9) return x - plane.n * plane.distance(x);
  return x;
}

}  // namespace limn
