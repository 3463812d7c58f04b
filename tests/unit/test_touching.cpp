// Edges that touch, united: how many there are, and what is around them.
#include "limn/edgetree/touching.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "limn/core/face_overlaps.h"
#include "support/edge_mesh_fault.h"
#include "support/meshes.h"

namespace limn {
namespace {

// A parallelogram of two faces.
Mesh quad(const Vec3f& corner, const Vec3f& a, const Vec3f& b) {
  return make_mesh({corner, corner + a, corner + a + b, corner + b}, {{0, 1, 2}, {0, 2, 3}});
}

// The sides of the cube [-1, 1]^3, facing outward.
std::vector<Mesh> cube_sides() {
  return {quad({-1, -1, -1}, {0, 2, 0}, {2, 0, 0}), quad({-1, -1, 1}, {2, 0, 0}, {0, 2, 0}),
          quad({-1, -1, -1}, {2, 0, 0}, {0, 0, 2}), quad({-1, 1, -1}, {0, 0, 2}, {2, 0, 0}),
          quad({-1, -1, -1}, {0, 0, 2}, {0, 2, 0}), quad({1, -1, -1}, {0, 2, 0}, {0, 0, 2})};
}

// looks: of each mesh; all alike if there are none.
std::vector<EdgeMesh> united(const std::vector<Mesh>& meshes,
                             const std::vector<uint32_t>& looks = {}) {
  std::vector<EdgeMesh> objects;
  std::vector<TouchingShape> shapes;
  std::vector<const Mesh*> pointers;
  for (uint32_t i = 0; i < meshes.size(); ++i) {
    objects.push_back(build_edge_mesh(meshes[i], true, ShapeId(i)));
    shapes.push_back({&meshes[i], looks.empty() ? 0 : looks[i]});
    pointers.push_back(&meshes[i]);
  }
  unite_touching_edges(shapes, find_face_pairs(pointers, {0, 0, 0}, 2), {0, 0, 0}, 2, objects);
  for (const EdgeMesh& object : objects) EXPECT_EQ(fault_of(object), "");
  return objects;
}

// Lengths of the edges that have this many faces around them, flat ones left out.
double length_with(const std::vector<EdgeMesh>& objects, size_t faces) {
  double sum = 0;
  for (const EdgeMesh& mesh : objects)
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      const Edge& edge = mesh.edges[e];
      if (edge.edge_class == EdgeClass::kFlat) continue;
      if (mesh.faces_around(EdgeId(e)).size() != faces) continue;
      sum += length(mesh.position(edge.vertices[1]) - mesh.position(edge.vertices[0]));
    }
  return sum;
}

uint64_t count(const std::vector<EdgeMesh>& objects, EdgeClass edge_class) {
  uint64_t sum = 0;
  for (const EdgeMesh& mesh : objects) sum += mesh.count(edge_class);
  return sum;
}

TEST(Touching, SidesOfACubeShareItsEdges) {
  Rng rng(1, 0, 0);
  for (const double scale : {1e-3, 1.0, 1e3}) {
    for (int i = 0; i < 20; ++i) {
      Vec3d rows[3];
      random_rotation(rng, rows);
      const Vec3d offset = random_direction(rng) * (3 * scale);
      std::vector<Mesh> sides;
      for (const Mesh& side : cube_sides()) sides.push_back(transformed(side, rows, scale, offset));
      const auto objects = united(sides);
      EXPECT_EQ(count(objects, EdgeClass::kBoundary), 0u) << scale;
      EXPECT_EQ(count(objects, EdgeClass::kIrregular), 12u) << scale;
      EXPECT_NEAR(length_with(objects, 2), 24 * scale, 1e-5 * scale);
    }
  }
}

TEST(Touching, NothingChangesWhereNothingTouches) {
  Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (const auto& [name, mesh] : test_meshes()) {
    // One step of a float apart is too far to be one mesh's, but for the tolerance.
    const std::vector<Mesh> meshes{mesh, transformed(mesh, identity, 1, {3, 0, 0})};
    const auto objects = united(meshes);
    for (uint32_t o = 0; o < 2; ++o) {
      const EdgeMesh before = build_edge_mesh(meshes[o], true, ShapeId(o));
      EXPECT_EQ(objects[o].edges.size(), before.edges.size()) << name;
      EXPECT_EQ(objects[o].incident_faces, before.incident_faces) << name;
      EXPECT_TRUE(objects[o].incidences.empty()) << name;
    }
  }
}

TEST(Touching, AGapIsNoContact) {
  const auto tiles = [](float gap) {
    return united({quad({-1, 0, 0}, {1, 0, 0}, {0, 1, 0}), quad({gap, 0, 0}, {1, 0, 0}, {0, 1, 0})},
                  {0, 1});
  };
  EXPECT_EQ(count(tiles(0), EdgeClass::kBoundary), 6u);
  EXPECT_EQ(count(tiles(0), EdgeClass::kIrregular), 1u);
  EXPECT_EQ(count(tiles(1e-7f), EdgeClass::kBoundary), 6u);
  EXPECT_EQ(count(tiles(1e-5f), EdgeClass::kBoundary), 8u);
}

TEST(Touching, TilesOfOneLookHaveNoSeam) {
  // One tile beside two of half its size.
  const std::vector<Mesh> tiles{quad({-2, 0, 0}, {2, 0, 0}, {0, 2, 0}),
                                quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}),
                                quad({0, 1, 0}, {1, 0, 0}, {0, 1, 0})};
  const auto alike = united(tiles);
  EXPECT_EQ(count(alike, EdgeClass::kIrregular), 0u);
  EXPECT_EQ(length_with(alike, 1), 10);
  const auto different = united(tiles, {0, 1, 1});
  EXPECT_EQ(count(different, EdgeClass::kIrregular), 2u);
  EXPECT_EQ(length_with(different, 2), 2);
  EXPECT_EQ(length_with(different, 1), 10);
}

TEST(Overlaps, AreInOnePlaneAndMoreThanASide) {
  const auto count = [](const Mesh& a, const Mesh& b) {
    Scene scene;
    scene.shapes.resize(2);
    scene.shapes[0].mesh = a;
    scene.shapes[1].mesh = b;
    const DuplicateFaces copies(scene);
    return FaceOverlaps(scene, copies, 1).pairs().size();
  };
  Rng rng(4, 0, 0);
  for (int i = 0; i < 20; ++i) {
    Vec3d rows[3];
    random_rotation(rng, rows);
    const auto turned = [&](const Mesh& mesh) { return transformed(mesh, rows, 1, {2, 1, 0}); };
    const Mesh tile = turned(quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0}));
    EXPECT_EQ(count(tile, turned(quad({1, 0, 0}, {1, 0, 0}, {0, 1, 0}))), 0u);
    EXPECT_EQ(count(tile, turned(quad({0.5f, 0, 1e-3f}, {1, 0, 0}, {0, 1, 0}))), 0u);
    EXPECT_EQ(count(tile, turned(quad({0.5f, 0, 0}, {1, 0, 0}, {0, 0, 1}))), 0u);
    EXPECT_EQ(count(tile, tile), 0u);  // copies: DuplicateFaces has them
    EXPECT_GE(count(tile, turned(quad({0.5f, 0.25f, 0}, {1, 0, 0}, {0, 1, 0}))), 2u);
    EXPECT_GE(count(tile, turned(quad({0.25f, 0.25f, 0}, {0.5f, 0, 0}, {0, 0.5f, 0}))), 2u);
  }
}

TEST(Overlaps, InOnePlaceWithSome) {
  Scene scene;
  scene.shapes.resize(4);
  scene.shapes[0].mesh = grid_mesh(4);
  scene.shapes[1].mesh = grid_mesh(4);  // copies
  const Vec3d rows[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  scene.shapes[2].mesh = transformed(grid_mesh(3), rows, 1, {0.1, 0.3, 0});
  scene.shapes[3].mesh = transformed(grid_mesh(3), rows, 1, {0.1, 0.3, 1});
  const DuplicateFaces copies(scene);
  const FaceOverlaps overlaps(scene, copies, 1);
  std::vector<FaceRef> all;
  for (uint32_t s = 0; s < 4; ++s)
    for (uint32_t f = 0; f < scene.shapes[s].mesh.faces.size(); ++f)
      all.push_back({ShapeId(s), FaceId(f)});
  Rng rng(8, 0, 0);
  size_t found = 0;
  for (int i = 0; i < 20; ++i) {
    std::vector<FaceRef> some;
    for (int k = 0; k < i % 4; ++k)
      some.push_back(all[static_cast<size_t>(rng.uniform() * static_cast<double>(all.size()))]);
    const FaceOverlaps::Set set = overlaps.in_place_of(some);
    for (const FaceRef face : all) {
      const bool expected = std::any_of(some.begin(), some.end(), [&](FaceRef one) {
        return one == face || overlaps.contains(one, face);
      });
      EXPECT_EQ(set.contains(face), expected);
      found += expected;
    }
  }
  EXPECT_GT(found, 100u);
  // What overlaps a face overlaps its copy.
  size_t others = 0;
  for (uint32_t f = 0; f < scene.shapes[0].mesh.faces.size(); ++f) {
    const auto of_first = overlaps.of({ShapeId(0), FaceId(f)});
    const auto of_copy = overlaps.of({ShapeId(1), FaceId(f)});
    EXPECT_TRUE(std::equal(of_first.begin(), of_first.end(), of_copy.begin(), of_copy.end())) << f;
    others += of_first.size();
  }
  EXPECT_GT(others, 0u);
}

TEST(Touching, ABoxStandsOnTheFloor) {
  Rng rng(2, 0, 0);
  for (int i = 0; i < 20; ++i) {
    Vec3d rows[3];
    random_rotation(rng, rows);
    Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    const Mesh box = transformed(cube_mesh(), identity, 0.5, {0.13, 0.21, 0.5});
    const Mesh floor = transformed(grid_mesh(1), identity, 3, {0, 0, 0});
    const auto objects =
        united({transformed(box, rows, 1, {2, 1, 0}), transformed(floor, rows, 1, {2, 1, 0})});
    // The floor's diagonal parts two of its faces, under the box as well.
    const EdgeMesh& edges = objects[0];
    double through = 0;
    for (uint32_t e = 0; e < edges.edges.size(); ++e) {
      const FacesAround around = edges.around(EdgeId(e));
      const auto [a, b] = edges.edges[e].vertices;
      for (size_t k = 0; k < around.faces.size(); ++k)
        if (around.incidence(k).through) through += length(edges.position(b) - edges.position(a));
    }
    EXPECT_NEAR(through, 4, 1e-5);
    EXPECT_GT(edges.edges.size(), build_edge_mesh(box, true).edges.size());
    EXPECT_EQ(objects[1].edges.size(), 5u);
  }
}

TEST(Touching, WhatMovesApartKeepsBothRims) {
  std::vector<Mesh> tiles{quad({-1, 0, 0}, {1, 0, 0}, {0, 1, 0}),
                          quad({0, 0, 0}, {1, 0, 0}, {0, 1, 0})};
  for (Mesh& tile : tiles) tile.position_tangents.assign(4, {});
  const auto irregular = [&] { return count(united(tiles), EdgeClass::kIrregular); };
  EXPECT_EQ(irregular(), 0u);
  tiles[1].position_tangents.assign(4, {{}, {}, {0, 0, 1, 0}});
  EXPECT_EQ(irregular(), 2u);
  const auto objects = united(tiles);
  for (const EdgeMesh& mesh : objects)
    for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
      if (mesh.edges[e].edge_class != EdgeClass::kIrregular) continue;
      const FacesAround around = mesh.around(EdgeId(e));
      ASSERT_EQ(around.faces.size(), 2u);
      EXPECT_NE(around.incidence(0).motion_group, around.incidence(1).motion_group);
      EXPECT_EQ(around.incidence(0).motion_group, mesh.edges[e].motion_group);
    }
  tiles[0].position_tangents.assign(4, {{}, {}, {0, 0, 1, 0}});
  EXPECT_EQ(irregular(), 0u);
}

// A sheet of strips, cut where its neighbour is whole, far from the origin: as it turns or grows
// there, velocities differ as much as the places do that were rounded apart.
TEST(Touching, TJunctionsFarAwayDoNotTear) {
  Rng rng(3, 0, 0);
  for (int i = 0; i < 20; ++i) {
    Vec3d rows[3];
    random_rotation(rng, rows);
    const Vec3d center{53.1, -17.3, 88.7};
    const auto sheet = [&](const Mesh& flat) {
      Mesh mesh = transformed(flat, rows, 1, center);
      for (const Vec3f& x : mesh.positions) {
        const Vec3d away = cast<double>(x) - center;
        Vec3<Lanes> v;
        for (int k = 0; k < 3; ++k) {
          v[k][0] = away[k];
          v[k][1] = cross(Vec3d{0, 1, 0}, away)[k];
        }
        mesh.position_tangents.push_back(v);
      }
      return mesh;
    };
    std::vector<Mesh> tiles{sheet(quad({-1, 0, 0}, {1, 0, 0}, {0, 1, 0})),
                            sheet(quad({0, 0, 0}, {1, 0, 0}, {0, 0.3f, 0})),
                            sheet(quad({0, 0.3f, 0}, {1, 0, 0}, {0, 0.7f, 0}))};
    const auto objects = united(tiles);
    EXPECT_NEAR(length_with(objects, 1), 6, 1e-4);  // its outline
    EXPECT_EQ(length_with(objects, 2) + length_with(objects, 3), 0);
    // But where they do move apart, they tear.
    Tangents& tangents = tiles[1].position_tangents;
    for (size_t v = 0; v < 4; ++v)
      tangents.set(v, tangents[v] + Vec3<Lanes>{{1e-3, 0, 0, 0}, {}, {}});
    EXPECT_GT(length_with(united(tiles), 2), 0.5);
  }
}

TEST(Touching, SeamsThatWereRoundedApartAreWelded) {
  // A tetrahedron cut open along an edge, one copy of whose ends is off by a rounding.
  for (const float scale : {1e-3f, 1.0f, 1e3f}) {
    std::vector<Vec3f> x{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 1, 0}, {0, 0, 1}};
    x[4].x = -2.4e-16f;
    x[5].z = std::nextafter(1.0f, 2.0f);
    for (Vec3f& p : x) p = p * scale;
    Mesh mesh = make_mesh(x, {{0, 2, 1}, {0, 1, 3}, {1, 4, 5}, {0, 3, 2}});
    EXPECT_EQ(build_edge_mesh(mesh, true).count(EdgeClass::kBoundary), 6u);
    weld_seams(mesh);
    EXPECT_EQ(build_edge_mesh(mesh, true).count(EdgeClass::kSharp), 6u);
    EXPECT_TRUE(build_edge_mesh(mesh, true).one_sided_closed);
    EXPECT_EQ(fault_of(build_edge_mesh(mesh, true)), "");
  }
}

TEST(Touching, SmallFacesAreNotWeldedAway) {
  // A grid whose cells are a few roundings wide.
  Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Mesh mesh = transformed(grid_mesh(4), identity, 0x1.0p-21, {1, 0, 0});
  const std::vector<uint32_t> before(mesh.weld);
  weld_seams(mesh);
  EXPECT_EQ(mesh.weld, before);
}

}  // namespace
}  // namespace limn
