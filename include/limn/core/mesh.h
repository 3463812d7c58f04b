#pragma once
// Triangle meshes, as the ray tracer, shading and edge samplers use them.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <type_traits>
#include <vector>

#include "limn/core/bounds.h"
#include "limn/core/dual.h"
#include "limn/core/error.h"
#include "limn/core/ids.h"
#include "limn/core/shared_vector.h"
#include "limn/core/tangents.h"
#include "limn/core/vec.h"

namespace limn {

// Three vertices (or normals), counter-clockwise from outside, as files and Embree have them.
using FaceIndices = std::array<uint32_t, 3>;

// A face of a scene, or none.
struct FaceRef {
  ShapeId shape;
  FaceId face;
  bool operator==(const FaceRef&) const = default;
};

// Largest coordinate allowed. Embree multiplies three lengths in single precision (a distance and
// two edges) and misses without an error if the product overflows: (2 sqrt(3) 2e12)^3 = 3.33e38
// just fits. (From 1.844e18 on Embree drops the triangle.)
inline constexpr double kLargestCoordinate = 2e12;

// A triangle of an emitter, counter-clockwise as seen from its emitting side.
struct LightTriangle {
  Vec3d corners[3];
  double luminance = 0;
};

enum class NormalSource {
  kFace,      // flat shading: the shading normal is the geometric normal
  kComputed,  // angle-weighted vertex normals over welded positions; they move with the vertices
  kGiven,     // vertex normals from the file; they follow rigid motions and stay fixed otherwise
};

// How texture coordinates follow from a mesh's `uv_places`, interpolated over a face.
enum class UvSource : uint8_t {
  kNone,    // there are none
  kPlane,   // u = x, v = y
  kSphere,  // place in the unit sphere: azimuth from +x over 2 pi, polar angle from +z over pi
  kDisk,    // place in the unit disk: distance from the center, azimuth over 2 pi
  kFaces,   // u = x, v = y, the barycentric coordinates of each face, where a file has none
};
// Whether u and v vary linearly over each face.
inline bool is_linear(UvSource source) {
  return source == UvSource::kPlane || source == UvSource::kFaces;
}

class MeshAttribute;  // mesh_attribute.h

// A mesh in world space. Positions are floats, so Embree, shading and edges use identical
// vertices.
struct Mesh {
  SharedVector<Vec3f> positions;    // V, scene units, as in the file (copies along seams are kept)
  SharedVector<FaceIndices> faces;  // F by 3, into positions
  SharedVector<uint32_t> weld;      // V: the smallest index of a vertex at the same position

  NormalSource normal_source = NormalSource::kFace;
  SharedVector<Vec3d> normals;           // N unit vectors; empty for kFace
  SharedVector<FaceIndices> normal_ids;  // F by 3, into normals; empty for kFace

  // True if the shape's material or emitter reads textures; else the next five are empty.
  bool textured = false;
  UvSource uv_source = UvSource::kNone;
  SharedVector<Vec3f> uv_places;
  SharedVector<FaceIndices> uv_ids;  // F by 3, into uv_places
  // Those that textures read; shared by copies of a mesh, copied by deep_copy().
  std::vector<std::shared_ptr<MeshAttribute>> attributes;
  SharedVector<uint32_t> file_faces;  // F: a face's index in the file; empty if its own

  // Whether the shape's material needs tangents (tangent.h). Where it does not, the next three
  // are empty.
  bool has_tangents = false;
  std::vector<Vec3d> u_directions;  // sums of unit vectors along which u grows, times angles
  std::vector<FaceIndices> u_ids;   // F by 3, into u_directions
  Tangents u_tangents;              // their derivatives; empty where all are zero

  // Derivatives with respect to the parameters of the pass; empty where all are zero.
  Tangents position_tangents;  // V
  Tangents normal_tangents;    // N

  // Number of faces that the loader removed because two of their corners coincide.
  uint64_t collapsed_faces = 0;

  const FaceIndices& face(FaceId id) const { return faces[id.index()]; }
  Vec3<Dual> position(VertexId id) const;
};

// The corners of a face in scalar type P.
template <class P>
std::array<Vec3<P>, 3> face_corners(const Mesh& mesh, FaceId face) {
  std::array<Vec3<P>, 3> corners;
  for (int k = 0; k < 3; ++k) {
    const VertexId vertex(mesh.face(face)[k]);
    if constexpr (std::is_same_v<P, double>) {
      corners[k] = cast<double>(mesh.positions[vertex.index()]);
    } else {
      corners[k] = mesh.position(vertex);
    }
  }
  return corners;
}

// True if the normals that a mesh interpolates are everywhere those of its faces, to rounding.
bool has_idle_normals(const Mesh& mesh);

// Fills `weld` from the positions: vertices with bitwise equal coordinates (-0 = 0) get the
// smallest of their indices.
void weld_positions(Mesh& mesh);

// Welds vertices along open seams whose positions differ by rounding only: two roundings to float
// of the largest coordinate of an adjacent face (a program writes -2.4e-16 here and 0 there).
// Slivers between such vertices collapse, but faces smaller than the rounding in both directions
// keep their corners apart. `weld` must hold the result of weld_positions for the remaining
// faces.
void weld_seams(Mesh& mesh);

// Computes normals (if kComputed) and their tangents from positions, faces, weld and
// tangents. Must be called after every change of positions or position_tangents. Normals are
// angle-weighted (Thuermer and Wuethrich 1998) over welded positions, so texture seams do not
// crease the shading.
void update_shading_normals(Mesh& mesh);

// True if a face has a nonzero area in double precision. A face without area is a line segment: no
// ray hits it, and it only connects other faces (half_edges.h). The error bound: each product of
// the normal is rounded once, each difference of products once more.
inline bool has_area(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d e1 = b - a, e2 = c - a, n = cross(e1, e2);
  return dot(n, n) > 0x1.0p-100 * (dot(e1, e1) * dot(e2, e2));
}
// For faces of a mesh slivers count as lines, too: narrower than the rounding of their corners to
// floats (four roundings of the largest coordinate), and 16 times longer than wide. Small faces far
// from the origin may be as narrow and still count as faces.
inline bool has_area(const Mesh& mesh, const FaceIndices& face) {
  const auto corner = [&](int k) { return cast<double>(mesh.positions[face[k]]); };
  const Vec3d a = corner(0), b = corner(1), c = corner(2);
  if (!has_area(a, b, c)) return false;
  const double longest =
      std::max({length_squared(b - a), length_squared(c - b), length_squared(a - c)});
  const double twice_area = length_squared(cross(b - a, c - a));
  if (twice_area * 256 > longest * longest) return true;
  double size = 0;
  for (const Vec3d& x : {a, b, c})
    size = std::max({size, std::fabs(x.x), std::fabs(x.y), std::fabs(x.z)});
  return twice_area > 0x1.0p-44 * size * size * longest;
}

// Makes a mesh from arrays, with the same repairs as for files: vertices at one position are
// welded; duplicate faces and faces with two coincident corners are removed, with a message in
// `warnings` (may be null). face_normals: flat shading, else computed normals. InputError at
// `where` if a position (V by 3, scene units) is not finite or beyond kLargestCoordinate, an index
// is not below V, or no face is left.
Mesh make_mesh(std::vector<Vec3f> positions, std::vector<FaceIndices> faces, bool face_normals,
               const SourceLocation& where, std::vector<std::string>* warnings);
// A mesh with the faces of `mesh` and as many new positions. Normals from a file are unchanged.
// Derivatives are zero.
Mesh moved_mesh(const Mesh& mesh, std::vector<Vec3f> positions, const SourceLocation& where,
                std::vector<std::string>* warnings);

// Bounds of all positions that faces use.
Bounds bounds_of(const Mesh& mesh);

// True if the file name ends in .obj or .ply (in any case).
bool is_mesh_file(const std::string& file);

// The mesh of a file (obj, unless the ending is ply). InputError (missing file, a word that is not
// understood, index out of range, position not finite or beyond kLargestCoordinate, no faces,
// non-triangle PLY face, ...) with the file and, where it can be known, the line and column.
// Polygons of OBJ files are split into triangles, concave ones too. Texture coordinates are read
// past: nothing in limn uses them. `face_normals` ignores normals of the file.
Mesh read_mesh(const std::string& file, bool face_normals);

// Reads a velocity field: positions of a mesh file, or lines "x y z" of a text file, in order.
std::vector<Vec3d> read_vertex_vectors(const std::string& file);

// V unit vectors, equal for welded vertices: angle-weighted means of the adjacent face normals,
// also if shading is flat or normals are given. Zero for a vertex without faces.
std::vector<Vec3d> displacement_directions(const Mesh& mesh);

}  // namespace limn
