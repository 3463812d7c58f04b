#pragma once
// Edges that touch faces or edges of any shape are split and united.
#include <array>
#include <span>
#include <vector>

#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// A shape as input to unite_touching_edges.
struct TouchingShape {
  const Mesh* mesh = nullptr;
  // Shapes with the same number look alike (same BSDF, no emission) and differ in geometry only.
  uint32_t look = 0;
  bool textured = false;  // its faces look different from one another
};

// Touching shapes with different motions.
struct TouchingMotion {
  std::vector<ContactLine> pressed;
  std::vector<std::array<ShapeId, 2>> parting;  // ascending; {s, s}: parts of one shape separate
};

// Rewrites the edges of all objects (object i is shape i, from build_edge_mesh), so that coincident
// edges become one edge that knows all faces touching it:
// - An edge is split where the set of faces it lies on changes: at ends of other edges along it
// (T-junctions, tiles of different size) and at boundaries of faces that it lies in.
// - Each part lists all faces around it (Incidence). It is irregular if it was a single edge
// before.
// - Of coincident parts with equal motion only that of the first shape remains. With different
// motions each remains, in a motion group with the faces that move alike.
// - A seam between coplanar faces of equal appearance and motion is no edge.
// Where faces rest on the interior of others, or edge on edge, and move towards or away from them,
// the parts are removed and returned as ContactLines. They describe the derivative for closing
// contact; opening contact would reveal a gap with different radiance. For a body sunk halfway into
// a face, the part on the viewer's side counts. Other shapes whose common edges separate or
// interpenetrate are listed in `parting`: the image is not differentiable there, and each edge
// keeps its one-sided contribution beside a gap (touching.cpp). Touching is decided up to the
// rounding of positions (edges/contacts.h). An edge also gets near faces, which float rays from
// `viewer` (the camera) or closer cannot resolve: FacesAround::near. Nothing changes elsewhere.
// pairs: of the shapes' faces, from find_face_pairs with the same viewer.
TouchingMotion unite_touching_edges(std::span<const TouchingShape> shapes,
                                    std::span<const FacePair> pairs, const Vec3d& viewer,
                                    int threads, std::vector<EdgeMesh>& objects);

}  // namespace limn
