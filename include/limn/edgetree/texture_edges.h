#pragma once
// Edges inside of faces: where the texture of a surface is discontinuous.
#include <span>

#include "limn/edgetree/edges.h"

namespace limn {

// A segment inside of a face, by the barycentric coordinates of the face's second and third corner.
struct FaceSegment {
  FaceId face;
  std::array<double, 2> from, to;
};

// The segments as edges of class texture, an object of their own. They move with the corners of
// their faces. edges: of the mesh; black_behind: as for build_edge_mesh. Faces without area and
// segments whose ends are one point have no edges.
EdgeMesh texture_edges(const Mesh& mesh, const EdgeMesh& edges, bool black_behind,
                       std::span<const FaceSegment> segments);

}  // namespace limn
