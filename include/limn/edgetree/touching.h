#pragma once
// Edges that touch faces or edges of any shape of a scene, united.
#include <array>
#include <span>
#include <vector>

#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/face_pairs.h"

namespace limn {

// One shape, as far as touching goes.
struct TouchingShape {
  const Mesh* mesh = nullptr;
  // Shapes of the same look are told apart by their geometry alone: same BSDF, no emission.
  uint32_t look = 0;
};

// What touches and moves differently.
struct TouchingMotion {
  std::vector<ContactLine> pressed;
  std::vector<std::array<ShapeId, 2>> parting;  // ascending; twice the same: a shape from itself
};

// Rewrites the edges of all objects (object i is shape i, as build_edge_mesh made it) so that edges
// in one place are one edge, and every edge knows all faces that touch it:
//  - an edge is split where faces that it lies on begin and end: at ends of other edges that run
//    along it (T-junctions, tiles of different size), at borders of faces that it lies in;
//  - each part lists all faces around it (Incidence), and is irregular if it was alone before;
//  - of parts of several edges in one place that move alike, the one of the first shape stays. If
//    they move differently each stays, as a rim of the faces that move with it;
//  - a seam of two faces in one plane that look and move alike is no edge.
// Parts on which one face stands on the inside of others, or on another body edge on edge, where
// these come towards it or leave it, are left out of the objects and returned: contact that
// tightens (ContactLine). Contact that loosens would open a gap, in which the light is another one.
// Of a body half sunk in a face the part on the viewer's side of that counts.
// Other shapes whose common edges part, or pass through each other, as they move are named: there
// the image has a kink, and each rim keeps what it would add beside a gap (touching.cpp).
// What touches is decided to the rounding of positions (edges/contacts.h). An edge also gets the
// faces that do not touch it and are nearer to it than a ray in floats can tell, if it comes from
// `viewer` (the camera) or from no farther away: FacesAround::near. Where nothing is so near
// nothing changes. pairs: of the shapes' faces, from find_face_pairs with the same viewer.
TouchingMotion unite_touching_edges(std::span<const TouchingShape> shapes,
                                    std::span<const FacePair> pairs, const Vec3d& viewer,
                                    int threads, std::vector<EdgeMesh>& objects);

}  // namespace limn
