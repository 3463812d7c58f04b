// The generated meshes are what their table says, at several sizes; the skies are finite.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <sstream>

#include "edgetree/edges/union_find.h"
#include "limn/core/ray_tracer.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"
#include "support/scenes.h"
#include "support/temp_files.h"
#include "tools/generate/generate.h"

namespace limn {
namespace {

struct Case {
  MeshKind kind;
  int faces;
};
// For the names of tests: without it they would show addresses.
void PrintTo(const Case& c, std::ostream* out) { *out << c.kind.name << " " << c.faces; }

std::vector<Case> cases() {
  std::vector<Case> all;
  for (const MeshKind& kind : mesh_kinds()) {
    for (const int faces : {kind.fewest_faces, kind.default_faces}) all.push_back({kind, faces});
  }
  return all;
}

std::string bytes_of(const std::string& file) {
  std::ostringstream bytes;
  bytes << std::ifstream(file, std::ios::binary).rdbuf();
  return bytes.str();
}

// As limn reads it back, with flat shading or with computed normals.
Mesh written(const Triangles& triangles, bool flat) {
  const TempFiles files;
  const std::string file = files.path("mesh.ply");
  write_triangles(file, triangles);
  Mesh mesh = read_mesh(file, flat);
  if (!flat) mesh.normal_source = NormalSource::kComputed;
  weld_positions(mesh);
  update_shading_normals(mesh);
  return mesh;
}

// The part that each vertex belongs to, as the smallest id in it.
std::vector<uint32_t> parts_of(const Triangles& mesh) {
  UnionFind parts(mesh.positions.size());
  for (const auto& [a, b, c] : mesh.faces) {
    const uint32_t least = std::min({parts.root(a), parts.root(b), parts.root(c)});
    for (const uint32_t v : {a, b, c}) parts.join(v, least);
  }
  std::vector<uint32_t> roots(mesh.positions.size());
  for (uint32_t v = 0; v < roots.size(); ++v) roots[v] = parts.root(v);
  return roots;
}

// Euler's V - E + F and six times the enclosed volume, of each part.
struct Part {
  int64_t euler = 0;
  double volume = 0;
};

std::map<uint32_t, Part> measure_parts(const Triangles& mesh, const EdgeMesh& edges) {
  const std::vector<uint32_t> part = parts_of(mesh);
  std::map<uint32_t, Part> parts;
  for (const uint32_t p : part) ++parts[p].euler;
  for (const Edge& edge : edges.edges) --parts[part[edge.vertices[0].index()]].euler;
  for (const auto& [a, b, c] : mesh.faces) {
    Part& p = parts[part[a]];
    ++p.euler;
    p.volume += determinant(mesh.positions[a], mesh.positions[b], mesh.positions[c]);
  }
  return parts;
}

class GeneratedMesh : public testing::TestWithParam<Case> {
 protected:
  const MeshKind& kind() const { return GetParam().kind; }
  Triangles mesh_ = make_mesh(GetParam().kind, GetParam().faces);
};

TEST_P(GeneratedMesh, HasAboutAsManyFacesAsAsked) {
  EXPECT_GT(mesh_.faces.size(), 0.75 * GetParam().faces);
  EXPECT_LT(mesh_.faces.size(), 1.3 * GetParam().faces);
}

TEST_P(GeneratedMesh, IsClosedWhereItSaysSo) {
  const Mesh mesh = written(mesh_, false);
  EXPECT_EQ(mesh.collapsed_faces, 0u);
  for (uint32_t v = 0; v < mesh.weld.size(); ++v) ASSERT_EQ(mesh.weld[v], v) << "a copy";
  const EdgeMesh edges = build_edge_mesh(mesh, true);
  EXPECT_EQ(edges.count(EdgeClass::kIrregular), 0u);
  EXPECT_EQ(edges.count(EdgeClass::kSharp), 0u);
  EXPECT_EQ(edges.count(EdgeClass::kBoundary) == 0, kind().closed);
  EXPECT_EQ(edges.one_sided_closed, kind().closed);
}

TEST_P(GeneratedMesh, HasItsPartsAndGenus) {
  const EdgeMesh edges = build_edge_mesh(written(mesh_, false), true);
  const std::map<uint32_t, Part> parts = measure_parts(mesh_, edges);
  EXPECT_EQ(parts.size(), static_cast<size_t>(kind().parts));
  if (!kind().closed) return;
  int64_t genus = 0;
  for (const auto& [id, part] : parts) {
    EXPECT_GT(part.volume, 0) << "the part of vertex " << id;
    genus += 1 - part.euler / 2;
  }
  EXPECT_EQ(genus, kind().genus);
}

TEST_P(GeneratedMesh, RestsWhereTheScenesExpectIt) {
  Bounds bounds;
  for (const Vec3d& p : mesh_.positions) bounds.extend(p);
  const Vec3d size = bounds.upper - bounds.lower;
  EXPECT_NEAR(std::max({size.x, size.y, size.z}), 1.98, 1e-12);
  EXPECT_NEAR(bounds.lower.y, -0.99, 1e-12);
  EXPECT_NEAR(bounds.center().x, 0, 1e-12);
  EXPECT_NEAR(bounds.center().z, 0, 1e-12);
}

TEST_P(GeneratedMesh, HasTheSameBytesEveryTime) {
  const TempFiles files;
  write_triangles(files.path("a.ply"), mesh_);
  write_triangles(files.path("b.ply"), make_mesh(kind(), GetParam().faces));
  EXPECT_TRUE(bytes_of(files.path("a.ply")) == bytes_of(files.path("b.ply")));
}

TEST_P(GeneratedMesh, DoesNotCrossItself) {
  const TempFiles files;
  write_triangles(files.path("mesh.obj"), mesh_);
  const Mesh mesh = read_mesh(files.path("mesh.obj"), true);
  const Mesh* meshes[] = {&mesh};
  EXPECT_TRUE(find_intersections(meshes, find_face_pairs(meshes, {}, 1), 1).empty());
}

TEST_P(GeneratedMesh, WritesTextureCoordinatesAndColours) {
  const TempFiles files;
  write_triangles(files.path("mesh.ply"), mesh_);
  const std::string bytes = bytes_of(files.path("mesh.ply"));
  EXPECT_EQ(bytes.find("float v\n") != std::string::npos, !mesh_.uv.empty());
  EXPECT_EQ(bytes.find("float b\n") != std::string::npos, !mesh_.colours.empty());
  for (const size_t count : {mesh_.uv.size(), mesh_.colours.size()}) {
    EXPECT_TRUE(count == 0 || count == mesh_.positions.size());
  }
}

INSTANTIATE_TEST_SUITE_P(, GeneratedMesh, testing::ValuesIn(cases()), [](const auto& test) {
  return std::string(test.param.kind.name) + "_" + std::to_string(test.param.faces);
});

// 90 degrees and 135 degrees between the faces at its creases, nothing between 20 and 40 degrees:
// the facets of the bores stay apart from the creases.
TEST(Bracket, HasSharpEdgesAndFlatSides) {
  for (const MeshKind& kind : mesh_kinds()) {
    if (kind.name != std::string("bracket")) continue;
    const EdgeMesh edges = build_edge_mesh(written(make_mesh(kind, 20000), true), true);
    EXPECT_EQ(edges.count(EdgeClass::kSmooth), 0u);
    int creases = 0;
    int right_angles = 0;
    for (const Edge& edge : edges.edges) {
      if (edge.edge_class != EdgeClass::kSharp) continue;
      const Vec3d &n0 = edges.plane(edge.faces[0]).n, &n1 = edges.plane(edge.faces[1]).n;
      const double cosine = dot(n0, n1) / (length(n0) * length(n1));
      const double angle = std::acos(std::min(1.0, cosine)) * 180 / kPi;
      EXPECT_FALSE(angle > 20 && angle < 38) << angle;
      creases += angle > 38;
      right_angles += std::fabs(angle - 90) < 0.1;
    }
    EXPECT_GT(creases, 500);
    EXPECT_GT(right_angles, 50);
    EXPECT_GT(edges.count(EdgeClass::kFlat), edges.count(EdgeClass::kSharp));
  }
}

TEST(GeneratedSkies, ArePositiveAndFitIntoHalfFloats) {
  for (const ImageKind& kind : sky_kinds()) {
    const Image image = kind.make();
    EXPECT_EQ(image.width, 2 * image.height) << kind.name;
    const auto [least, most] = std::ranges::minmax(image.data);
    EXPECT_GT(least, 0) << kind.name;
    EXPECT_LT(most, 65504) << kind.name;
  }
}

TEST(GeneratedTextures, AreReflectances) {
  for (const ImageKind& kind : texture_kinds()) {
    const Image image = kind.make();
    const auto [least, most] = std::ranges::minmax(image.data);
    EXPECT_GT(least, 0) << kind.name;
    EXPECT_LT(most, 1) << kind.name;
  }
}

TEST(MeshFiles, OtherEndingsAreRefused) {
  try {
    write_triangles("mesh.stl", {});
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "mesh.stl: error: mesh files end with .ply or .obj");
  }
}

}  // namespace
}  // namespace limn
