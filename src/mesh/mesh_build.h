#pragma once
// From what a mesh file says to a checked mesh in world space.
#include <string>
#include <vector>

#include "limn/core/matrix.h"
#include "limn/core/mesh.h"

namespace limn {

inline constexpr uint32_t kNoNormal = UINT32_MAX;

// A mesh as read: double precision, indices checked, polygons split into triangles.
struct RawMesh {
  SourceLocation where;                 // the file, or the element of a built-in shape
  std::vector<Vec3d> positions;         // V, finite
  std::vector<FaceIndices> faces;       // F by 3, into positions
  std::vector<Vec3d> normals;           // N, of any length; not finite or zero: unusable
  std::vector<FaceIndices> normal_ids;  // F by 3, into normals or kNoNormal; empty if no normals
  // The first position with a coordinate beyond kLargestCoordinate, and where it stands, if the
  // file has lines and such a one.
  size_t far_position = SIZE_MAX;
  SourceLocation far_where = {};
};

// update_shading_normals, and at how many vertices computed normals are none of their own because
// the normals around them cancel.
size_t fill_shading_normals(Mesh& mesh);

struct MeshOptions {
  Matrix4 to_world;           // invertible
  bool face_normals = false;  // ignore normals, flat shading
  bool flip_normals = false;  // reverse faces and normals
};

// Whether the transform is a reflection, whatever it is beside that.
bool mirrors(const Matrix4& to_world);

// The transform acts in double precision before positions are rounded to float. Where it mirrors,
// computed normals and those of faces turn with the winding, so that the outside is inside, as in
// Mitsuba up to 3.9; given normals keep their outside, and the faces are wound anew.
// Faces whose corners coincide, to a billionth of their longest side, are left out. What was mended
// is appended to `warnings` (may be null). InputError if no face is left or a position lies beyond
// kLargestCoordinate.
Mesh build_mesh(const RawMesh& raw, const MeshOptions& options, std::vector<std::string>* warnings);

}  // namespace limn
