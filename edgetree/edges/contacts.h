#pragma once
// Contacts: where edges lie on faces, up to the rounding of positions, and near faces, which rays
// cannot resolve from an edge.
//
// touch_tolerance(M) covers the rounding of positions of size M, the largest coordinate of a face
// (not of a vertex, since a vertex near the origin is rounded with its neighbours). Slivers may be
// narrower than that and would touch along both sides. They touch only what coincides with them to
// a millionth of their width, and are near to the rest.
#include <span>
#include <vector>

#include "limn/core/touch.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// A part [t0, t1] of an edge that lies on a face which is not adjacent to it.
struct Contact {
  EdgeRef edge;
  FaceRef face;
  double t0, t1;
  // The edge of the face's mesh along the part; none if the part is inside of the face.
  EdgeId along;
};

// Limit on nearness, as a share of an edge's length or a face's longest side.
inline constexpr double kMostNear = 0x1.0p-8;
// An edge and a non-adjacent face that is near to at least a sixteenth of it: closer than the reach
// of either's faces (face_pairs.h). The face runs along the edge, or leaves a common corner at a
// slope below a sixteenth.
struct NearFace {
  EdgeRef edge;
  FaceRef face;
};

struct Contacts {
  std::vector<Contact> contacts;  // sorted by edge
  std::vector<NearFace> near;     // sorted by edge; also for edges that touch the face
};

// Finds the contacts of all edges with non-degenerate faces; flat edges get only faces in other
// planes, and no near faces. Two edges along each other get the same decision. meshes: of the
// objects; pairs, viewer: as for find_face_pairs.
Contacts find_contacts(std::span<const EdgeMesh> objects, std::span<const Mesh* const> meshes,
                       std::span<const FacePair> pairs, const Vec3d& viewer, int threads);

// The size M of the faces of `mesh` around an edge, see above.
double size_around(const EdgeMesh& edges, const Mesh& mesh, EdgeId edge);

}  // namespace limn
