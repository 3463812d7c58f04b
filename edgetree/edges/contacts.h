#pragma once
// Where edges of a scene lie on faces of it, to the rounding of positions, and which faces are
// nearer to them than rays can tell.
//
// What the rounding of positions of size M explains is touch_tolerance(M). M is the largest
// coordinate of a face, not of a vertex: a vertex near the origin was rounded where its neighbours
// are. Needles may be narrower than that, and would touch along both of their sides: they touch
// what is in their place to a millionth of their width, and are near to the rest.
#include <span>
#include <vector>

#include "limn/core/touch.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// A part [t0, t1] of an edge that lies on a face which is not among those around it.
struct Contact {
  EdgeRef edge;
  FaceRef face;
  double t0, t1;
  // The edge of the face's mesh that runs along there; none if the edge lies inside the face.
  EdgeId along;
};

// Nearness ends at this share of an edge's length, or of a face's longest side.
inline constexpr double kMostNear = 0x1.0p-8;
// An edge, and a face that is near to at least a sixteenth of it, but is not around it: nearer than
// the reach of either's faces (face_pairs.h). A near face lies along the edge, or leaves a common
// corner at less than a sixteenth.
struct NearFace {
  EdgeRef edge;
  FaceRef face;
};

struct Contacts {
  std::vector<Contact> contacts;  // by edge
  std::vector<NearFace> near;     // by edge; also of edges that touch the face
};

// Of edges with faces that have area; of flat edges with faces in other planes alone, and none
// near. Whether two edges run along each other is decided for the two alike. meshes: of the
// objects; pairs, viewer: as find_face_pairs has them.
Contacts find_contacts(std::span<const EdgeMesh> objects, std::span<const Mesh* const> meshes,
                       std::span<const FacePair> pairs, const Vec3d& viewer, int threads);

// The size of the faces of `mesh` around an edge: M above.
double size_around(const EdgeMesh& edges, const Mesh& mesh, EdgeId edge);

}  // namespace limn
