#pragma once
// Intersection curves of surfaces, which are boundaries of visibility.
#include <array>
#include <span>
#include <vector>

#include "limn/core/mesh.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// The segment in which two faces intersect.
struct IntersectionSegment {
  std::array<FaceRef, 2> faces;
  // In double precision, on both planes to rounding. Where the curve continues across an edge, the
  // adjacent segments share the end bit for bit.
  std::array<Vec3d, 2> ends;
};

// Finds all pairs of intersecting faces: each has corners strictly on both sides of the other's
// plane, and both share a segment of the planes' line. A corner within the rounding of float
// positions counts as on the plane, so faces that touch (at a corner, along an edge, in a plane) do
// not intersect. Faces with a common corner may intersect. meshes: of the scene's shapes, in order;
// pairs: from find_face_pairs, for any viewer. The result is sorted by faces and does not depend on
// `threads`.
std::vector<IntersectionSegment> find_intersections(std::span<const Mesh* const> meshes,
                                                    std::span<const FacePair> pairs, int threads);

// Velocity of the intersection line of two faces at a point x of it: the vector in the span of both
// normals that has each plane's normal velocity. Linear in x along the line, since velocities are
// linear over a face. Zero in lanes where neither face moves.
Vec3<Lanes> intersection_velocity(std::span<const Mesh* const> meshes,
                                  const IntersectionSegment& segment, const Vec3d& x);

// A part of an edge that rests on faces of other shapes which move towards it or away from it: the
// bottom edge of a box on a floor that is raised, or on an equal box. When pressed, the box ends at
// its intersection with the floor, which moves by intersection_velocity.
struct ContactLine {
  EdgeRef edge;
  std::array<Vec3d, 2> ends;
  uint8_t motion_group = 0;
  // All faces around it (edges.h): first the face that ends here, then one that it rests on.
  std::vector<FaceRef> faces;
  std::vector<Incidence> incidences;
  std::vector<FaceRef> near = {};  // FacesAround::near
};

// Converts the segments, then the contact lines, to edges: class kIntersection, each with its own
// two vertices, planes and faces; a segment lies inside of both faces. Edges move by
// intersection_velocity; `shape` is none.
EdgeMesh intersection_edges(std::span<const Mesh* const> meshes,
                            std::span<const IntersectionSegment> segments,
                            std::span<const ContactLine> contacts = {});

}  // namespace limn
