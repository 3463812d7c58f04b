#pragma once
// Directed sides of faces over welded vertices, with faces of zero area taken out.
#include <cstdint>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

// A side of a face, or a part of one where a face of zero area met it.
struct HalfEdge {
  VertexId from, to;  // welded, in the face's winding
  FaceId face;
  VertexId opposite;  // the corner of the face off this side, welded
};

// V: the id under which a vertex takes part in edges: the smallest index of a vertex at the same
// position that moves alike in every lane (to the rounding of floats). Copies that move apart tear
// the surface: they keep ids of their own, so that both rims become borders.
std::vector<VertexId> edge_vertex_ids(const Mesh& mesh);

// The sides of all faces that have area. A face of zero area is a line segment: it is invisible,
// and only says that its long side equals its two short ones. So it is left out, and the sides of
// its neighbours are split at the corners that lie on them: the real neighbours meet.
// ids: V, from edge_vertex_ids
std::vector<HalfEdge> half_edges_of(const Mesh& mesh, const std::vector<VertexId>& ids);

}  // namespace limn
