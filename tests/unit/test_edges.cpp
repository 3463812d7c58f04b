// Edges of meshes: adjacency, classes and the candidate test.
#include "limn/edgetree/edges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

#include "../support/meshes.h"
#include "support/edge_mesh_fault.h"

namespace limn {
namespace {

// Border, irregular, sharp, smooth, flat.
using Counts = std::array<uint64_t, 5>;
Counts counts_of(const EdgeMesh& mesh) {
  return {mesh.count(EdgeClass::kBoundary), mesh.count(EdgeClass::kIrregular),
          mesh.count(EdgeClass::kSharp), mesh.count(EdgeClass::kSmooth),
          mesh.count(EdgeClass::kFlat)};
}

// Edges by the positions of their ends, whatever the vertex ids.
using Point = std::tuple<double, double, double>;
std::multiset<std::tuple<Point, Point, EdgeClass, bool>> edges_in_space(const EdgeMesh& mesh) {
  std::multiset<std::tuple<Point, Point, EdgeClass, bool>> edges;
  for (const Edge& e : mesh.edges) {
    const Vec3d &a = mesh.position(e.vertices[0]), &b = mesh.position(e.vertices[1]);
    const auto [low, high] = std::minmax({Point{a.x, a.y, a.z}, Point{b.x, b.y, b.z}});
    edges.emplace(low, high, e.edge_class, e.concave);
  }
  return edges;
}

uint64_t concave_count(const EdgeMesh& mesh) {
  return std::count_if(mesh.edges.begin(), mesh.edges.end(),
                       [](const Edge& e) { return e.concave; });
}

TEST(Edges, ClassesOfSimpleMeshes) {
  const auto counts = [](const Mesh& mesh) { return counts_of(build_edge_mesh(mesh, true)); };
  EXPECT_EQ(counts(tetrahedron_mesh()), (Counts{0, 0, 6, 0, 0}));
  EXPECT_EQ(counts(cube_mesh()), (Counts{0, 0, 12, 0, 6}));
  EXPECT_EQ(counts(with_smooth_normals(cube_mesh())), (Counts{0, 0, 0, 12, 6}));
  EXPECT_EQ(counts(icosphere_mesh(2)), (Counts{0, 0, 480, 0, 0}));
  EXPECT_EQ(counts(with_smooth_normals(icosphere_mesh(2))), (Counts{0, 0, 0, 480, 0}));
  EXPECT_EQ(counts(grid_mesh(5)), (Counts{20, 0, 0, 0, 65}));
  EXPECT_EQ(counts(with_smooth_normals(grid_mesh(5))), (Counts{20, 0, 0, 0, 65}));
}

TEST(Edges, FirstFaceRunsAlongTheEdge) {
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeMesh edges = build_edge_mesh(mesh, true);
    size_t sides = 0;
    for (uint32_t e = 0; e < edges.edges.size(); ++e) {
      const auto [from, to] = edges.edges[e].vertices;
      const FaceIndices& face = mesh.face(edges.edges[e].faces[0]);
      int matches = 0;
      for (int k = 0; k < 3; ++k)
        matches += mesh.weld[face[k]] == from.index() && mesh.weld[face[(k + 1) % 3]] == to.index();
      EXPECT_EQ(matches, 1) << name << " edge " << e;
      EXPECT_EQ(edges.faces_around(EdgeId(e))[0].face, edges.edges[e].faces[0]);
      sides += edges.faces_around(EdgeId(e)).size();
    }
    EXPECT_EQ(sides, 3 * mesh.faces.size()) << name;
  }
}

TEST(Edges, SeamsAreWelded) {
  for (const auto& [name, mesh] : test_meshes()) {
    const Mesh split =
        mesh.normals.empty() ? seam_split(mesh) : with_smooth_normals(seam_split(mesh));
    const EdgeMesh whole = build_edge_mesh(mesh, true), seams = build_edge_mesh(split, true);
    EXPECT_EQ(edges_in_space(whole), edges_in_space(seams)) << name;
    EXPECT_EQ(whole.one_sided_closed, seams.one_sided_closed) << name;
  }
}

TEST(Edges, ClassesSurviveRotationAndScale) {
  Rng rng(1, 0, 0);
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeMesh original = build_edge_mesh(mesh, true);
    for (double scale : {1e-3, 0.1, 1.0, 30.0, 1e4}) {
      for (int i = 0; i < 20; ++i) {
        Vec3d rows[3];
        random_rotation(rng, rows);
        const EdgeMesh turned = build_edge_mesh(transformed(mesh, rows, scale, {}), true);
        ASSERT_EQ(turned.edges.size(), original.edges.size());
        EXPECT_EQ(turned.one_sided_closed, original.one_sided_closed) << name;
        for (uint32_t e = 0; e < turned.edges.size(); ++e) {
          EXPECT_EQ(turned.edges[e].edge_class, original.edges[e].edge_class) << name << scale;
          EXPECT_EQ(turned.edges[e].concave, original.edges[e].concave) << name << scale;
        }
      }
    }
  }
}

TEST(Edges, ConcaveEdges) {
  EXPECT_EQ(concave_count(build_edge_mesh(icosphere_mesh(2), true)), 0u);
  EXPECT_EQ(concave_count(build_edge_mesh(reversed(icosphere_mesh(2)), true)), 480u);
  // A torus is concave where it circles on the inside: an edge there has its ends near the hole.
  const EdgeMesh torus = build_edge_mesh(torus_mesh(24, 12), true);
  EXPECT_GT(concave_count(torus), 0u);
  for (const Edge& e : torus.edges) {
    if (!e.concave) continue;
    const Vec3d middle = (torus.position(e.vertices[0]) + torus.position(e.vertices[1])) * 0.5;
    EXPECT_LT(std::hypot(middle.x, middle.y), 1.0);
  }
}

TEST(Edges, ClosedMeansClosedAndOutwardInEveryPart) {
  const auto closed = [](const Mesh& mesh) { return build_edge_mesh(mesh, true).one_sided_closed; };
  Vec3d identity[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const Mesh cube = cube_mesh(), far_cube = transformed(cube, identity, 1, {5, 0, 0});
  EXPECT_TRUE(closed(cube));
  EXPECT_TRUE(closed(torus_mesh(24, 12)));
  EXPECT_TRUE(closed(joined(cube, far_cube)));
  EXPECT_FALSE(build_edge_mesh(cube, false).one_sided_closed);
  EXPECT_FALSE(closed(reversed(cube)));
  EXPECT_FALSE(closed(joined(cube, reversed(transformed(cube, identity, 0.5, {5, 0, 0})))));
  EXPECT_FALSE(closed(grid_mesh(3)));
  // A sheet of two sides is closed but holds nothing.
  EXPECT_FALSE(closed(make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}, {0, 2, 1}})));
}

TEST(Edges, IrregularEdges) {
  const std::vector<Vec3f> x{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 1}, {0, -1, -1}};
  const auto counts = [&](const std::vector<FaceIndices>& faces) {
    return counts_of(build_edge_mesh(make_mesh(x, faces), true));
  };
  EXPECT_EQ(counts({{0, 1, 2}, {1, 0, 3}}), (Counts{4, 0, 1, 0, 0}));
  EXPECT_EQ(counts({{0, 1, 2}, {1, 0, 3}, {1, 0, 4}}), (Counts{6, 1, 0, 0, 0}));
  EXPECT_EQ(counts({{0, 1, 2}, {0, 1, 3}}), (Counts{4, 1, 0, 0, 0}));  // wound the same way
  EXPECT_EQ(counts({{0, 1, 2}, {0, 1, 2}}), (Counts{0, 3, 0, 0, 0}));  // the same face twice
  // The two sides of a sheet fold back: never flat.
  EXPECT_EQ(counts({{0, 1, 2}, {0, 2, 1}}), (Counts{0, 0, 3, 0, 0}));
  const EdgeMesh fan = build_edge_mesh(make_mesh(x, {{0, 1, 2}, {1, 0, 3}, {1, 0, 4}}), true);
  for (uint32_t e = 0; e < fan.edges.size(); ++e)
    EXPECT_EQ(fan.faces_around(EdgeId(e)).size(),
              fan.edges[e].edge_class == EdgeClass::kIrregular ? 3u : 1u);
}

TEST(Edges, GivenNormalsDecideSharpness) {
  Mesh mesh = make_mesh({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, -1, 1}}, {{0, 1, 2}, {1, 0, 3}});
  mesh.normal_source = NormalSource::kGiven;
  mesh.normals = {{0, 0, 1}, {0, 0.6, 0.8}, {0, 0, 1}};
  const auto class_with = [&](const FaceIndices& second) {
    mesh.normal_ids = {{0, 1, 0}, second};
    return build_edge_mesh(mesh, true);
  };
  // The shared edge runs from vertex 0 (normal 0) to vertex 1 (normal 1); the second face lists
  // vertex 1 first. Normal 2 equals normal 0.
  EXPECT_EQ(class_with({1, 0, 1}).count(EdgeClass::kSmooth), 1u);
  EXPECT_EQ(class_with({1, 2, 1}).count(EdgeClass::kSmooth), 1u);
  EXPECT_EQ(class_with({1, 1, 1}).count(EdgeClass::kSharp), 1u);
  EXPECT_EQ(class_with({0, 0, 1}).count(EdgeClass::kSharp), 1u);
}

// A cube whose top front edge has a middle corner on one side only, the gap filled by a face
// without area.
Mesh cube_with_t_junction(const std::vector<Vec3f>& middles, const std::vector<FaceIndices>& top,
                          const std::vector<FaceIndices>& fill) {
  Mesh cube = cube_mesh();
  std::vector<FaceIndices> faces;
  for (const FaceIndices& f : cube.faces)  // the top is z = 1: corners 4, 5, 7, 6
    if (*std::min_element(f.begin(), f.end()) < 4) faces.push_back(f);
  faces.insert(faces.end(), top.begin(), top.end());
  faces.insert(faces.end(), fill.begin(), fill.end());
  for (const Vec3f& middle : middles) cube.positions.push_back(middle);
  return make_mesh(cube.positions, faces);
}

TEST(Edges, FacesWithoutAreaLetTheirNeighboursMeet) {
  // Vertex 8 lies on the edge from 4 to 5, in use by the top alone.
  const std::vector<FaceIndices> top{{4, 8, 6}, {8, 7, 6}, {8, 5, 7}};
  const EdgeMesh open = build_edge_mesh(cube_with_t_junction({{0.3f, -1, 1}}, top, {}), true);
  EXPECT_EQ(open.count(EdgeClass::kBoundary), 3u);
  const EdgeMesh mended =
      build_edge_mesh(cube_with_t_junction({{0.3f, -1, 1}}, top, {{4, 5, 8}}), true);
  EXPECT_EQ(counts_of(mended), (Counts{0, 0, 13, 0, 7}));
  EXPECT_TRUE(mended.one_sided_closed);

  // Three middle corners, filled by a chain of faces; their order is not the faces' order.
  const std::vector<Vec3f> three{{0.3f, -1, 1}, {-0.25f, -1, 1}, {0.9f, -1, 1}};
  const std::vector<FaceIndices> finer{{4, 9, 6}, {9, 8, 6}, {8, 7, 6}, {8, 10, 7}, {10, 5, 7}};
  const std::vector<FaceIndices> chain{{4, 5, 8}, {4, 8, 9}, {5, 10, 8}};
  const EdgeMesh long_chain = build_edge_mesh(cube_with_t_junction(three, finer, chain), true);
  EXPECT_EQ(counts_of(long_chain), (Counts{0, 0, 15, 0, 9}));
  EXPECT_TRUE(long_chain.one_sided_closed);
}

TEST(Edges, FacesWithCoincidentCornersVanish) {
  Mesh mesh = cube_mesh();
  mesh.positions.push_back(mesh.positions[4]);  // vertex 8: a copy of vertex 4
  std::vector<FaceIndices> faces(mesh.faces);
  faces.push_back({4, 5, 8});
  const EdgeMesh edges = build_edge_mesh(make_mesh(mesh.positions, faces), true);
  EXPECT_EQ(edges_in_space(edges), edges_in_space(build_edge_mesh(cube_mesh(), true)));
  EXPECT_EQ(length(edges.planes.back().n), 0);
}

TEST(Edges, ZeroAreaIsDecidedToTheRoundingOfPositions) {
  const Vec3f a{0, 0, 0}, c{3, 6, 9};
  const auto planes = [&](const Vec3f& b) {
    return build_edge_mesh(make_mesh({a, b, c}, {{0, 1, 2}}), true).planes;
  };
  EXPECT_EQ(length(planes({1, 2, 3})[0].n), 0);
  // A needle that rounding its corners explains is a line; a little wider, it is a face, and so is
  // a small one of another shape.
  EXPECT_EQ(length(planes({1, std::nextafter(2.0f, 3.0f), 3})[0].n), 0);
  EXPECT_NEAR(length(planes({1, 2 + 0x1.0p-17f, 3})[0].n), 1, 0x1.0p-50);
  const Mesh far = make_mesh({{9, 6, 3}, {9 + 0x1p-20f, 6, 3}, {9, 6 + 0x1p-20f, 3}}, {{0, 1, 2}});
  EXPECT_NEAR(length(build_edge_mesh(far, true).planes[0].n), 1, 0x1.0p-50);
  EXPECT_EQ(length(planes({0x1.00002p-30f, 0x1.00002p-29f, 3 * 0x1.00002p-30f})[0].n), 0);
}

TEST(Edges, NeedlesDoNotHideACrease) {
  // As the T-junction, but the middle corner is one step of the last digit off the line, so that
  // the filling face has area and is coplanar, to rounding, with both its neighbours.
  const std::vector<FaceIndices> top{{4, 8, 6}, {8, 7, 6}, {8, 5, 7}};
  const Mesh mesh =
      cube_with_t_junction({{0.3f, -1, std::nextafter(1.0f, 2.0f)}}, top, {{4, 5, 8}});
  const EdgeMesh edges = build_edge_mesh(mesh, true);
  for (const auto& ends : {std::pair{VertexId(4), VertexId(8)}, {VertexId(5), VertexId(8)}}) {
    const auto found = std::find_if(edges.edges.begin(), edges.edges.end(), [&](const Edge& e) {
      const auto [low, high] = std::minmax(e.vertices[0], e.vertices[1]);
      return std::pair(low, high) == ends;
    });
    ASSERT_NE(found, edges.edges.end());
    EXPECT_EQ(found->edge_class, EdgeClass::kSharp);
  }
}

TEST(Edges, TornSeamsHaveTwoRims) {
  Mesh mesh = seam_split(grid_mesh(1));  // two triangles, three vertices each
  mesh.position_tangents.assign(6, {});
  EXPECT_EQ(counts_of(build_edge_mesh(mesh, true)), (Counts{4, 0, 0, 0, 1}));
  for (int v = 0; v < 6; ++v)
    mesh.position_tangents.set(v, {Lanes{1, 0, 0, v < 3 ? 0.0 : 2.0}, {}, {}});
  const EdgeMesh torn = build_edge_mesh(mesh, true);
  EXPECT_EQ(counts_of(torn), (Counts{6, 0, 0, 0, 0}));
  for (const Edge& e : torn.edges)
    EXPECT_EQ(torn.tangent(e.vertices[0]).x[3], e.faces[0] == FaceId(0) ? 0 : 2);
}

TEST(Edges, DistancesAreRightToTheirBound) {
  Rng rng(2, 0, 0);
  for (const auto& [name, mesh] : test_meshes()) {
    const EdgeMesh edges = build_edge_mesh(mesh, true);
    for (int i = 0; i < 200; ++i) {
      const Vec3d p = random_direction(rng) * std::exp(12 * rng.uniform() - 4);
      for (uint32_t f = 0; f < mesh.faces.size(); ++f) {
        using Real = long double;
        const Vec3<Real> a = cast<Real>(mesh.positions[mesh.faces[f][0]]);
        const Vec3<Real> n = cross(cast<Real>(mesh.positions[mesh.faces[f][1]]) - a,
                                   cast<Real>(mesh.positions[mesh.faces[f][2]]) - a);
        const Real exact = dot(normalize(n), cast<Real>(p) - a);
        EXPECT_LE(std::fabs(edges.planes[f].distance(p) - exact), distance_error(edges, p)) << name;
      }
    }
  }
}

TEST(Edges, PointsOnAPlaneKeepTheEdge) {
  // Points on the plane of one face of an edge see that edge, whichever way the distance rounds.
  Rng rng(3, 0, 0);
  const Mesh mesh = with_smooth_normals(icosphere_mesh(1));
  const EdgeMesh edges = build_edge_mesh(mesh, true);
  for (uint32_t e = 0; e < edges.edges.size(); ++e) {
    const FaceIndices& face = mesh.face(edges.edges[e].faces[e % 2]);
    const Vec3d a = edges.positions[face[0]];
    for (int i = 0; i < 50; ++i) {
      const Vec3d p = a + (edges.positions[face[1]] - a) * (10 * rng.uniform() - 5) +
                      (edges.positions[face[2]] - a) * (10 * rng.uniform() - 5);
      EXPECT_TRUE(is_candidate(edges, EdgeId(e), p));
    }
  }
}

// On a closed mesh the faces in front of p and those behind it meet along closed loops.
TEST(Edges, SilhouettesFormLoops) {
  Rng rng(4, 0, 0);
  for (const Mesh& shape : {icosphere_mesh(3), torus_mesh(40, 20), cube_mesh()}) {
    // If the mesh were black from behind, the concave parts of the loops would be missing.
    const EdgeMesh edges = build_edge_mesh(with_smooth_normals(shape), false);
    for (double radius : {0.05, 1.5, 3.0, 1e3, 1e6}) {
      const Vec3d p = random_direction(rng) * radius;
      std::map<VertexId, int> degree;
      uint64_t count = 0;
      for (uint32_t e = 0; e < edges.edges.size(); ++e) {
        if (!is_candidate(edges, EdgeId(e), p)) continue;
        ++count;
        for (const VertexId v : edges.edges[e].vertices) ++degree[v];
      }
      for (const auto& [vertex, edges_at] : degree) EXPECT_EQ(edges_at % 2, 0);
      if (radius > 1.5) {
        EXPECT_GT(count, 3u);
      }
    }
  }
  // Nothing of a convex mesh is a silhouette from inside; from outside, a cube shows four to six.
  const EdgeMesh sphere = build_edge_mesh(with_smooth_normals(icosphere_mesh(3)), true);
  const EdgeMesh cube = build_edge_mesh(with_smooth_normals(cube_mesh()), true);
  for (uint32_t e = 0; e < sphere.edges.size(); ++e)
    EXPECT_FALSE(is_candidate(sphere, EdgeId(e), {0.1, 0.2, -0.3}));
  const auto cube_count = [&](const Vec3d& p) {
    int count = 0;
    for (uint32_t e = 0; e < cube.edges.size(); ++e) count += is_candidate(cube, EdgeId(e), p);
    return count;
  };
  EXPECT_EQ(cube_count({0.2, 0.3, 4}), 4);
  EXPECT_EQ(cube_count({0.2, 3, 4}), 6);
  EXPECT_EQ(cube_count({-2, 3, 4}), 6);
}

TEST(Edges, SharpEdgesNeedAFaceInFront) {
  const Mesh mesh = cube_mesh();
  const EdgeMesh closed = build_edge_mesh(mesh, true), two_sided = build_edge_mesh(mesh, false);
  const auto count = [](const EdgeMesh& edges, const Vec3d& p) {
    int sharp = 0;
    for (uint32_t e = 0; e < edges.edges.size(); ++e)
      sharp += edges.edges[e].edge_class == EdgeClass::kSharp && is_candidate(edges, EdgeId(e), p);
    return sharp;
  };
  EXPECT_EQ(count(closed, {0.2, 0.3, 4}), 4);    // the edges of one side
  EXPECT_EQ(count(closed, {0.2, 3, 4}), 7);      // of two
  EXPECT_EQ(count(closed, {-2, 3, 4}), 9);       // of three
  EXPECT_EQ(count(closed, {0.2, 0.3, 0.1}), 0);  // from inside, all is black
  EXPECT_EQ(count(two_sided, {0.2, 0.3, 0.1}), 12);
}

TEST(EdgeMesh, IsValidForAllMeshes) {
  for (const auto& [name, mesh] : test_meshes())
    for (const bool black_behind : {false, true})
      EXPECT_EQ(fault_of(build_edge_mesh(mesh, black_behind)), "") << name;
  EXPECT_EQ(fault_of(EdgeMesh(build_edge_mesh(make_mesh({}, {}), true))), "");
}

// The same with the faces around its edges in arrays.
EdgeMesh with_face_arrays(const EdgeMesh& mesh) {
  EdgeMesh listed = mesh;
  listed.face_offsets = {0};
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    for (const FaceRef face : mesh.faces_around(EdgeId(e))) listed.incident_faces.push_back(face);
    listed.face_offsets.push_back(static_cast<uint32_t>(listed.incident_faces.size()));
  }
  return listed;
}

// Each change breaks one thing that validate names.
TEST(EdgeMesh, CorruptedCopiesAreFound) {
  using Change = void (*)(EdgeMesh&);
  const std::pair<const char*, Change> changes[] = {
      {"there are other than V tangents", [](EdgeMesh& m) { m.tangents.resize(1); }},
      {"there are other than E + 1 offsets", [](EdgeMesh& m) { m.face_offsets.pop_back(); }},
      {"offsets do not span the incident faces", [](EdgeMesh& m) { m.incident_faces.pop_back(); }},
      {"an edge has no faces", [](EdgeMesh& m) { m.face_offsets[3] = m.face_offsets[4]; }},
      {"an edge's face is out of range", [](EdgeMesh& m) { m.edges[1].faces[1] = FaceId(1000); }},
      {"an incident face is out of range",
       [](EdgeMesh& m) { m.incident_faces[2].face = FaceId(1000); }},
      {"a vertex is out of range", [](EdgeMesh& m) { m.edges[2].vertices[1] = VertexId(1000); }},
      {"face 3: a plane's normal is not a unit vector", [](EdgeMesh& m) { m.planes[3].n.x += 1; }},
      {"face 3: a plane without a normal has an offset", [](EdgeMesh& m) { m.planes[3].n = {}; }},
      {"edge 0: its two ends are one vertex",
       [](EdgeMesh& m) { m.edges[0].vertices[0] = m.edges[0].vertices[1]; }},
      {"edge 2: edges are not sorted by their vertices",
       [](EdgeMesh& m) { m.edges[2] = m.edges[1]; }},
      {"edge 0: an end lies beyond the extent", [](EdgeMesh& m) { m.extent *= 0.5; }},
      {"edge 4: its first face is not the first around it",
       [](EdgeMesh& m) { std::swap(m.edges[4].faces[0], m.edges[4].faces[1]); }},
      {"edge 4: its second face is not the second around it",
       [](EdgeMesh& m) { m.edges[4].faces[1] = FaceId::none(); }},
      {"edge 0: an end lies off the plane of a face around it",
       [](EdgeMesh& m) { m.planes[m.edges[0].faces[0].index()].offset += 1e-6; }},
      {"there are other incidences than incident faces",
       [](EdgeMesh& m) { m.incidences.resize(3); }},
      {"edge 2: its own mesh's faces do not come first",
       [](EdgeMesh& m) {
         m.incident_faces.insert(m.incident_faces.begin() + m.face_offsets[2] + 1,
                                 {ShapeId(1), FaceId(0)});
         for (size_t e = 3; e < m.face_offsets.size(); ++e) ++m.face_offsets[e];
         m.edges[2].faces[1] = FaceId::none();
       }},
      {"edge 1: a face that it runs through has a motion_group",
       [](EdgeMesh& m) {
         m.incidences.resize(m.incident_faces.size());
         m.incidences[m.face_offsets[1]].through = true;
       }},
      {"edge 1: a motion_group is out of range",
       [](EdgeMesh& m) {
         m.incidences.resize(m.incident_faces.size());
         m.incidences[m.face_offsets[1]].motion_group = kMostMotionGroups;
       }},
      {"edge 7: no face around it moves with it", [](EdgeMesh& m) { m.edges[7].motion_group = 1; }},
      {"edge 5: a border has one face",
       [](EdgeMesh& m) { m.edges[5].edge_class = EdgeClass::kBoundary; }},
      {"edge 5: a closed mesh has neither borders nor irregular edges",
       [](EdgeMesh& m) { m.edges[5].edge_class = EdgeClass::kIrregular; }},
      {"edge 5: only smooth and sharp edges are concave",
       [](EdgeMesh& m) {
         m.edges[5].edge_class = EdgeClass::kFlat;
         m.edges[5].concave = true;
       }},
  };
  Mesh mesh = icosphere_mesh(1);
  set_test_tangents(mesh);
  const EdgeMesh plain = build_edge_mesh(mesh, true), whole = with_face_arrays(plain);
  ASSERT_TRUE(plain.face_offsets.empty());
  ASSERT_EQ(fault_of(plain), "");
  ASSERT_EQ(fault_of(whole), "");
  for (const auto& [fault, change] : changes) {
    EdgeMesh copy = whole;
    change(copy);
    EXPECT_EQ(fault_of(copy), fault);
  }
}

}  // namespace
}  // namespace limn
