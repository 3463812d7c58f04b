#pragma once
// Triangle meshes: what the ray tracer, the shading and the edge samplers all read.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <string>
#include <type_traits>
#include <vector>

#include "limn/core/bounds.h"
#include "limn/core/dual.h"
#include "limn/core/error.h"
#include "limn/core/ids.h"
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

// No coordinate may be larger. Embree multiplies three lengths in single precision (a distance and
// two edges), and a product that does not fit is a miss, in silence: (2 sqrt(3) 2e12)^3 = 3.33e38
// just fits. (At 1.844e18 Embree drops the triangle altogether.)
inline constexpr double kLargestCoordinate = 2e12;

// A triangle of an emitter, wound counter-clockwise seen from where it shines.
struct LightTriangle {
  Vec3d corners[3];
  double luminance = 0;
};

enum class NormalSource {
  kFace,      // flat shading: the shading normal is the geometric normal
  kComputed,  // angle-weighted vertex normals over welded positions; they move with the vertices
  kGiven,     // vertex normals from the file; they follow rigid motions and stay fixed otherwise
};

// One mesh in world space. Positions are stored as floats: Embree, shading and edges all see the
// same vertices.
struct Mesh {
  std::vector<Vec3f> positions;    // V, scene units, as in the file (seam copies are kept)
  std::vector<FaceIndices> faces;  // F by 3, into positions
  std::vector<uint32_t> weld;      // V: the smallest index of a vertex at the same position

  NormalSource normal_source = NormalSource::kFace;
  std::vector<Vec3d> normals;           // N unit vectors; empty for kFace
  std::vector<FaceIndices> normal_ids;  // F by 3, into normals; empty for kFace
  // V: sine of the largest tilt between shading and geometric normal over the faces around the
  // vertex, the same for welded vertices; empty for kFace. Its interpolation bounds the tilt at any
  // point (see shading.h).
  std::vector<double> horizon;

  // Derivatives of the above with respect to the parameters of the pass; empty where all are zero.
  std::vector<Vec3<Lanes>> position_tangents;  // V
  std::vector<Vec3<Lanes>> normal_tangents;    // N
  std::vector<Lanes> horizon_tangents;         // V

  // What the loader mended: faces that were left out because two of their corners coincide.
  uint64_t collapsed_faces = 0;

  const FaceIndices& face(FaceId id) const { return faces[id.index()]; }
  Vec3<Dual> position(VertexId id) const;
};

// Corners of a face as the scalar P.
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

// Fills `weld` from the positions: vertices at bitwise equal coordinates (with -0 = 0) share the
// smallest index.
void weld_positions(Mesh& mesh);

// Welds copies of a vertex that differ by no more than the rounding of their positions (a float's,
// twice, of the largest coordinate of a face around them), where sides of faces lie open: seams as
// programs write them, -2.4e-16 here and 0 there. Needles between copies collapse; but where faces
// are no larger than the rounding in any direction, their corners stay apart. `weld` must hold what
// weld_positions says of the faces that are left.
void weld_seams(Mesh& mesh);

// Fills normals (if kComputed), horizon and their tangents from positions, faces, weld and
// tangents. Called at load and after every change of positions or position_tangents. Angle-weighted
// normals after Thuermer and Wuethrich 1998, over welded positions, so that texture seams leave no
// crease.
void update_shading_normals(Mesh& mesh);

// The adjoint of update_shading_normals. normals (N), horizons (V): derivatives of some number with
// respect to them. Adds what follows for the positions to `positions` (V), at the first copy of
// each welded vertex. Normals of the file do not follow positions: what horizons do to them is
// added to `normals`. Where several tilts tie for a horizon, each has an equal share in it (forward
// mode takes the middle of the least and the largest slope, which depends on the motion in no
// linear way).
void pull_back_shading_normals(const Mesh& mesh, std::vector<Vec3d>& normals,
                               const std::vector<double>& horizons, std::vector<Vec3d>& positions);

// Whether a face has an area, and so a plane, as far as double precision can tell; else it is a
// line, which no ray meets and which only ties other faces together (half_edges.h). Each product of
// the normal is rounded once, each difference of products once more.
inline bool has_area(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
  const Vec3d e1 = b - a, e2 = c - a, n = cross(e1, e2);
  return dot(n, n) > 0x1.0p-100 * (dot(e1, e1) * dot(e2, e2));
}
// Of a mesh, needles are lines, too: faces that are narrower than what rounding their corners to
// floats explains (four roundings of the largest coordinate) and 16 times longer than wide. Far
// from the origin small faces are as narrow, and mean what they are.
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

// A mesh from arrays, mended as one from a file is: vertices at one position are welded, faces that
// repeat or have two corners at one position are left out, and `warnings` (may be null) says so.
// face_normals: flat shading, else normals are computed. InputError (at `where`) for positions (V
// by 3, scene units) that are not finite or beyond kLargestCoordinate, indices that are not below
// V, and where no face is left.
Mesh make_mesh(std::vector<Vec3f> positions, std::vector<FaceIndices> faces, bool face_normals,
               const SourceLocation& where, std::vector<std::string>* warnings);
// The same from new positions and the faces of `mesh`; normals of a file stay as they are. As many
// positions as the mesh has. Derivatives are zero.
Mesh moved_mesh(const Mesh& mesh, std::vector<Vec3f> positions, const SourceLocation& where,
                std::vector<std::string>* warnings);

// Bounds of all positions referenced by faces.
Bounds bounds_of(const Mesh& mesh);

// Mesh files: obj or ply, by the ending of the file's name (in small or capital letters).
bool is_mesh_file(const std::string& file);

// The mesh of a file (obj, unless the ending is ply). InputError (missing file, a word that is not
// understood, index out of range, position not finite or beyond kLargestCoordinate, no faces,
// non-triangle PLY face, ...) with the file and, where it can be known, the line and column.
// Polygons of OBJ files are split into triangles, concave ones too. Texture coordinates are read
// past: nothing in limn uses them. `face_normals` ignores normals of the file.
Mesh read_mesh(const std::string& file, bool face_normals);

// Positions of a mesh file, or of a text file with "x y z" lines, in file order: a velocity field.
std::vector<Vec3d> read_vertex_vectors(const std::string& file);

}  // namespace limn
