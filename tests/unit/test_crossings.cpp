// Crossing surfaces are found, and nothing else: against all pairs of edge and face.
#include "limn/integrators/crossings.h"

#include <gtest/gtest.h>

#include "limn/core/ray_tracer.h"
#include "limn/edgetree/edges.h"
#include "support/meshes.h"

namespace limn {
namespace {

Scene scene_of(const std::vector<Mesh>& meshes) {
  Scene scene;
  for (const Mesh& mesh : meshes) {
    Shape shape;
    shape.mesh = mesh;
    shape.bsdf = make_diffuse({0.5, 0.5, 0.5});
    scene.shapes.push_back(shape);
  }
  return scene;
}

uint64_t found(const Scene& scene) {
  return find_crossings(scene, *make_embree_tracer(scene, 1)).edges;
}

// The segment from p to q passes through the triangle: p and q lie on different sides of it, and
// all tetrahedra of the segment and a side of the triangle turn the same way.
bool passes(const Vec3d& p, const Vec3d& q, const std::array<Vec3d, 3>& t) {
  const auto volume = [](const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
    return determinant(b - a, c - a, d - a);
  };
  if (volume(p, t[0], t[1], t[2]) * volume(q, t[0], t[1], t[2]) >= 0) return false;
  const double u = volume(p, q, t[0], t[1]);
  const double v = volume(p, q, t[1], t[2]);
  const double w = volume(p, q, t[2], t[0]);
  return (u > 0 && v > 0 && w > 0) || (u < 0 && v < 0 && w < 0);
}

// Edges that pass through some face without a vertex in common.
uint64_t counted(const Scene& scene) {
  uint64_t count = 0;
  for (const Shape& shape : scene.shapes) {
    const EdgeMesh edges = build_edge_mesh(shape.mesh, false);
    for (const Edge& edge : edges.edges) {
      const Vec3d p = edges.position(edge.vertices[0]);
      const Vec3d q = edges.position(edge.vertices[1]);
      count += std::ranges::any_of(scene.shapes, [&](const Shape& other) {
        return std::ranges::any_of(other.mesh.faces, [&](const FaceIndices& face) {
          std::array<Vec3d, 3> t;
          for (int i = 0; i < 3; ++i) t[i] = cast<double>(other.mesh.positions[face[i]]);
          const auto is_corner = [&](const Vec3d& x) { return std::ranges::find(t, x) != t.end(); };
          return !is_corner(p) && !is_corner(q) && passes(p, q, t);
        });
      });
    }
  }
  return count;
}

Mesh placed(const Mesh& mesh, uint64_t seed, double scale, const Vec3d& offset) {
  Rng rng(seed, 0, 0);
  Vec3d rows[3];
  random_rotation(rng, rows);
  return transformed(mesh, rows, scale, offset);
}

TEST(Crossings, AreThoseOfAllPairs) {
  for (uint64_t seed = 0; seed < 5; ++seed) {
    const Scene scene = scene_of({placed(icosphere_mesh(2), seed, 1, {0, 0, 0}),
                                  placed(cube_mesh(), seed + 100, 0.7, {0.6, 0.3, -0.2}),
                                  placed(torus_mesh(24, 12), seed + 200, 1, {-0.5, 0, 0.4})});
    EXPECT_GT(counted(scene), 50u);
    EXPECT_EQ(found(scene), counted(scene)) << seed;
  }
}

TEST(Crossings, OfOneShapeWithItself) {
  const Mesh both = joined(placed(icosphere_mesh(2), 1, 1, {0, 0, 0}),
                           placed(icosphere_mesh(2), 2, 1, {0.9, 0.1, 0}));
  const Scene scene = scene_of({both});
  EXPECT_GT(counted(scene), 20u);
  EXPECT_EQ(found(scene), counted(scene));
}

// Edges of a plane cut into many faces lie in the planes of the others, but for rounding.
TEST(Crossings, NoneWithinAPlane) {
  for (uint64_t seed = 0; seed < 10; ++seed) {
    const Scene scene = scene_of({placed(grid_mesh(24), seed, 1.3, {0.2, 1, -0.4})});
    EXPECT_EQ(found(scene), 0u) << seed;
  }
}

TEST(Crossings, NoneWhereOneLiesWithinTheOther) {
  const Scene scene = scene_of({icosphere_mesh(2), placed(icosphere_mesh(2), 3, 0.5, {0, 0, 0})});
  EXPECT_EQ(found(scene), 0u);
}

}  // namespace
}  // namespace limn
