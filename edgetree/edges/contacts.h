#pragma once
// Where edges of a scene lie on faces of it, to the rounding of positions.
//
// A position is taken to have been rounded to float twice (in a file, and after its transform): what
// the rounding of positions of size M explains is touch_tolerance(M). M is the largest coordinate of
// a face, not of a vertex: a vertex near the origin was rounded where its neighbours are.
#include <span>
#include <vector>

#include "limn/edgetree/edges.h"

namespace limn {

// sqrt(3) * 2 * 2^-24 for each of two positions, rounded up.
inline double touch_tolerance(double size_a, double size_b) {
  return 0x1.0p-22 * (size_a + size_b);
}
// What is no longer than this many tolerances is a point: ends of overlaps are off by some.
inline constexpr double kShortestTouch = 8;

// A part [t0, t1] of an edge that lies on a face which is not among those around it.
struct Contact {
  EdgeRef edge;
  FaceRef face;
  double t0, t1;
  // The edge of the face's mesh that runs along there; none if the edge lies inside the face.
  EdgeId along;
};

// All contacts of edges that are not flat with faces that have area and are not so thin that they
// lie on the edge as a whole; by edge. Whether two edges run along each other is decided for the
// two alike. meshes: of the objects.
std::vector<Contact> find_contacts(std::span<const EdgeMesh> objects,
                                   std::span<const Mesh* const> meshes, int threads);

// The size of the faces of `mesh` around an edge: M above.
double size_around(const EdgeMesh& edges, const Mesh& mesh, EdgeId edge);

}  // namespace limn
