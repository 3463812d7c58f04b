// The edge forest rejects no edge of E(p): its listing against the exact test of every edge.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "../support/meshes.h"
#include "edgetree/forest/edge_forest.h"

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
  const std::vector<FaceIndices> faces = mesh.faces;
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

double random_scale(Rng& rng) { return std::exp(std::log(1e-3) + std::log(1e7) * rng.uniform()); }

// On a plane, at a vertex, on an edge, inside, near or far.
Vec3d random_point(const EdgeMesh& mesh, double scale, Rng& rng) {
  const Edge& edge = mesh.edges[static_cast<size_t>(rng.uniform() * mesh.edges.size())];
  const Vec3d a = mesh.positions[edge.vertices[0]], b = mesh.positions[edge.vertices[1]];
  const Plane& plane = mesh.planes[edge.faces[0]];
  const double kind = rng.uniform(), u = rng.uniform();
  if (kind < 0.1) return a;
  if (kind < 0.2) return a * (1 - u) + b * u;
  const Vec3d direction = random_direction(rng);
  const double far = std::exp(std::log(1e6) * u);
  const Vec3d x = a + direction * (scale * (kind < 0.6 ? far : 2 * u));
  if (kind < 0.3 || kind > 0.9) return x - plane.n * plane.distance(x);
  return x;
}

void expect_complete(const EdgeSamplerInput& input, const EdgeForest& forest, const Vec3d& p,
                     const std::string& name) {
  std::vector<EdgeId> listed;
  forest.list_silhouettes(p, listed);
  std::vector<std::vector<bool>> found;
  for (const EdgeMesh& mesh : input.objects) found.emplace_back(mesh.edges.size(), false);
  for (EdgeId id : listed) {
    EXPECT_FALSE(found[id.object][id.edge]) << name << ": listed twice";
    found[id.object][id.edge] = true;
  }
  for (uint32_t o = 0; o < input.objects.size(); ++o)
    for (uint32_t e = 0; e < input.objects[o].edges.size(); ++e)
      EXPECT_EQ(found[o][e], is_candidate(input.objects[o], e, p))
          << name << " object " << o << " edge " << e << " p " << p.x << " " << p.y << " " << p.z;
}

class Forests : public testing::TestWithParam<ForestConfig> {};

TEST_P(Forests, ListWhatTheExactTestLists) {
  Rng rng(21, 0, 0);
  const std::vector<NamedMesh> meshes = meshes_of_all_kinds(rng);
  for (const auto& [name, mesh] : meshes) {
    for (int i = 0; i < 6; ++i) {
      Vec3d rows[3];
      random_rotation(rng, rows);
      const double scale = random_scale(rng), shift = i % 2 == 0 ? 0 : 1e4 * rng.uniform();
      const Mesh moved = transformed(mesh, rows, scale, random_direction(rng) * shift);
      const Mesh other = transformed(mesh, rows, 0.1 * scale, {});
      const EdgeSamplerInput input{
          {build_edge_mesh(moved, i % 3 != 0), build_edge_mesh(other, true)}};
      const auto forest = EdgeForest::build(input, 1, GetParam());
      for (int k = 0; k < 60; ++k)
        expect_complete(input, *forest, random_point(input.objects[k % 2], scale, rng), name);
      if (HasFailure()) return;
    }
  }
}

ForestConfig without(bool ForestConfig::*option) {
  ForestConfig config;
  config.*option = false;
  return config;
}
INSTANTIATE_TEST_SUITE_P(Variants, Forests,
                         testing::Values(ForestConfig{}, without(&ForestConfig::principal_axes),
                                         without(&ForestConfig::cull_concave),
                                         ForestConfig{.width = 2}));

TEST(Forest, DoesNotDependOnThreads) {
  Rng rng(22, 0, 0);
  Mesh mesh = with_smooth_normals(torus_mesh(80, 60));
  const EdgeSamplerInput input{{build_edge_mesh(mesh, true)}};
  const auto one = EdgeForest::build(input, 1), seven = EdgeForest::build(input, 7);
  for (int i = 0; i < 20; ++i) {
    const Vec3d p = random_direction(rng) * 3.0;
    std::vector<EdgeId> a, b;
    EXPECT_EQ(one->list_silhouettes(p, a), seven->list_silhouettes(p, b));
    EXPECT_EQ(a, b);
  }
}

}  // namespace
}  // namespace limn
