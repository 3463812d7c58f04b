#pragma once
// The curves along which surfaces pass through one another.
#include <array>
#include <span>
#include <vector>

#include "limn/core/mesh.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// Where two faces pass through each other, along their whole length.
struct CrossingSegment {
  std::array<FaceRef, 2> faces;
  // In double precision, on both planes to its rounding. Where the curve goes on from face to face
  // across an edge, both segments have the same bits for the end they share.
  std::array<Vec3d, 2> ends;
};

// All pairs of faces that pass through each other: each has corners strictly on both sides of the
// other's plane, and they have a segment of that line in common. A corner counts as on the plane
// where the rounding of positions to floats can explain its distance: faces that touch (in a
// corner, along an edge, in a plane, or to rounding) do not cross. Two faces with a common corner
// may. meshes: of the scene's shapes, whose places name them; pairs: from find_face_pairs, of any
// viewer. The result does not depend on `threads`; sorted by faces.
std::vector<CrossingSegment> find_crossings(std::span<const Mesh* const> meshes,
                                            std::span<const FacePair> pairs, int threads);

// The velocity of the line where two faces cross, at a point x of it: across the line, with each
// plane's normal velocity, so within the plane that their normals span. Along the line it is linear
// in x, because velocities are over a face. Zero in lanes where neither face moves.
Vec3<Lanes> crossing_velocity(std::span<const Mesh* const> meshes, const CrossingSegment& segment,
                              const Vec3d& x);

// A part of an edge of a shape that stands on faces of others, which come towards it or leave it:
// the bottom of a box on a floor that is lifted or pressed, or on an equal box. As it is pressed,
// the box ends where it crosses the floor, and that line moves as crossing_velocity says.
struct ContactLine {
  EdgeRef edge;
  std::array<Vec3d, 2> ends;
  uint8_t rim = 0;
  // All faces around it (edges.h): first the one that stands, then one that it stands on.
  std::vector<FaceRef> faces;
  std::vector<Incidence> incidences;
  std::vector<FaceRef> near = {};  // FacesAround::near
};

// The segments as edges, in their order, then the lines of contact: class kCrossing, each with two
// vertices, two planes and two faces of its own, which segments have on both sides of them. Moves
// as crossing_velocity says; `shape` is none.
EdgeMesh crossing_edges(std::span<const Mesh* const> meshes,
                        std::span<const CrossingSegment> segments,
                        std::span<const ContactLine> contacts = {});

}  // namespace limn
