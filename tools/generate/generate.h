#pragma once
// Meshes, skies and textures made by formula: the same bytes every time, for scenes, tests and
// the demo.
#include <array>
#include <span>
#include <string>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/mesh.h"

namespace limn {

// Vertices are shared: positions that coincide are one vertex.
struct Triangles {
  std::vector<Vec3d> positions;           // V
  std::vector<FaceIndices> faces;         // F, counter-clockwise from outside
  std::vector<std::array<double, 2>> uv;  // V texture coordinates, or none
  std::vector<Rgb<double>> colours;       // V linear reflectances, or none
};

// What a mesh is, at every size; tests/unit/test_generate.cpp holds it to this.
struct MeshKind {
  const char* name;
  const char* description;
  int default_faces;
  int fewest_faces;  // below, the shape would be lost
  bool closed;       // every edge has two faces; each part encloses positive volume
  int parts;         // connected
  int genus;         // summed over the parts; of a mesh with borders, of its closed parts
  Triangles (*make)(int faces);  // about that many, to a quarter
};
inline constexpr int kMostFaces = 500000;

struct ImageKind {
  const char* name;
  const char* description;
  Image (*make)();
};

std::span<const MeshKind> mesh_kinds();
std::span<const ImageKind> sky_kinds();      // maps as the emitter `envmap` reads them, +y up
std::span<const ImageKind> texture_kinds();  // linear reflectances in [0, 1]

// A mesh as the scenes expect it: the longest side of its bounds is 1.98, centered in x and z, the
// lowest point at y = -0.99 (where the Stanford bunny of glmark2-data has its feet).
Triangles make_mesh(const MeshKind& kind, int faces);

// FILE.ply (binary, with texture coordinates and colours) or FILE.obj (positions alone), without
// normals. InputError for other endings and for files that cannot be written.
void write_triangles(const std::string& file, const Triangles& mesh);

}  // namespace limn
