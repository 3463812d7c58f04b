#pragma once
// Converts a mesh as read from a file to a checked mesh in world space.
#include <array>
#include <string>
#include <vector>

#include "limn/core/matrix.h"
#include "limn/core/mesh.h"

namespace limn {

inline constexpr uint32_t kNoNormal = UINT32_MAX;

// A mesh as read: double precision, valid indices, polygons triangulated.
struct RawMesh {
  SourceLocation where;                 // the file, or the element of a built-in shape
  std::vector<Vec3d> positions;         // V, finite
  std::vector<FaceIndices> faces;       // F by 3, into positions
  std::vector<Vec3d> normals;           // N, of any length; unusable if not finite or zero
  std::vector<FaceIndices> normal_ids;  // F by 3, into normals or kNoNormal; empty if no normals
  // The first position beyond kLargestCoordinate, if any, and its location, if the file has
  // lines.
  size_t far_position = SIZE_MAX;
  SourceLocation far_where = {};
  // Texture coordinates, as in Mesh; kNone if there are none.
  UvSource uv_source = UvSource::kNone;
  std::vector<Vec3f> uv_places = {};
  std::vector<FaceIndices> uv_ids = {};  // F by 3, into uv_places
  // Of vertices (V) or faces (F), by the beginning of its name; see mesh_attribute.h.
  struct Attribute {
    std::string name;
    std::vector<std::array<float, 3>> values;
  };
  std::vector<Attribute> attributes = {};
};

// update_shading_normals; returns the number of vertices whose adjacent normals cancel, so that a
// face normal was used.
size_t fill_shading_normals(Mesh& mesh);

struct MeshOptions {
  Matrix4 to_world;           // invertible
  bool face_normals = false;  // ignore normals, flat shading
  bool flip_normals = false;  // reverse orientation and normals
  bool textured = false;      // keep texture coordinates, see Mesh::textured
  bool tangents = false;      // see Mesh::has_tangents; requires texture coordinates
  bool file_faces = false;    // keep those of textured meshes, too
};

// True if the transform is a reflection (possibly combined with other transforms).
bool mirrors(const Matrix4& to_world);

// Transforms in double precision before positions are rounded to float. A reflection
// turns computed normals and face orientation inside out, as in Mitsuba up to 3.9;
// normals from a file keep their side, and faces are reoriented. Faces whose corners
// coincide, up to a billionth of their longest side, are removed. Appends repairs to
// `warnings` (may be null). InputError if no face is left or a position is beyond
// kLargestCoordinate.
Mesh build_mesh(const RawMesh& raw, const MeshOptions& options, std::vector<std::string>* warnings);

// The share of a uniform light that the outside of a mesh loses because faces are flat: of the
// directions above the smooth surface, in the cosine measure, those that lie below the face and
// meet it again from where rays start (limn/core/surface_lift.h). 0 where normals are the faces'.
// The mean over the area, but for points whose shading normal opposes the face.
double lost_light(const Mesh& mesh);

// Updates normal_tangents of computed normals after a change of position_tangents; the rest must be
// up to date. Empty if all vertices move alike.
void update_shading_tangents(Mesh& mesh);

}  // namespace limn
