#pragma once
// The classes of edges, by where radiance is discontinuous across them.
#include <cstdint>

namespace limn {

enum class EdgeClass : uint8_t {
  // Two faces with continuous shading normals: discontinuous only as a silhouette.
  kSmooth,
  // Two faces with different shading normals: discontinuous if p sees one of the faces.
  kSharp,
  // A boundary edge, with one face: discontinuous from everywhere.
  kBoundary,
  // Non-manifold: more than two faces, two of opposite orientation, or united edges (touching.h).
  // Treated as discontinuous from everywhere.
  kIrregular,
  // Two coplanar faces (exactly, or to rounding) with equal shading normals: discontinuous only
  // from their common plane.
  kFlat,
  // An intersection segment of two faces of any shapes, see crossing_curves.h. Treated as
  // discontinuous from everywhere.
  kIntersection,
  // A segment inside of a face where its texture is discontinuous (texture_edges.h): discontinuous
  // where p sees the face. It hides nothing.
  kTexture,
};

const char* edge_class_name(EdgeClass edge_class);

}  // namespace limn
