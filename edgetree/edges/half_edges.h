#pragma once
// Directed sides of faces over welded vertices, with degenerate faces removed.
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

// A side of a face, or a part of one beside a degenerate face.
struct HalfEdge {
  VertexId from, to;  // welded, in the face's orientation
  FaceId face;
  VertexId opposite;  // the opposite corner of the face, welded
};

// V: the vertex id used in edges: the smallest index of a vertex at the same position with the same
// motion in every lane (up to float rounding). Copies with different motions keep separate ids, so
// both sides of the tear become boundary edges.
std::vector<VertexId> edge_vertex_ids(const Mesh& mesh);

// Sides of all non-degenerate faces. A degenerate face is an invisible line segment: its
// long side equals its two short ones. It is removed, and the sides of its neighbours
// are split at its corners, so that the real neighbours connect. ids: V, from
// edge_vertex_ids
std::vector<HalfEdge> half_edges_of(const Mesh& mesh, const std::vector<VertexId>& ids);

}  // namespace limn
