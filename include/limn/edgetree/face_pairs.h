#pragma once
// Pairs of a scene's faces that lie near each other: among them are all that touch or cross.
#include <span>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

struct FacePair {
  FaceRef first, second;  // in the order of the shapes and their faces
};

// All pairs of faces whose boxes overlap, each box wider by how far rays in floats may miss points
// of the face (blur_of) and positions may be off by their rounding; but none with a common corner
// around which the surface is a closed fan that covers the directions around it once, seen along
// the mean of its normals: faces of such a fan have no other point in common. meshes: of the
// scene's shapes, whose places name them; their weld must be filled. In an order of its own, which
// does not depend on `threads`.
std::vector<FacePair> find_face_pairs(std::span<const Mesh* const> meshes, const Vec3d& viewer,
                                      int threads);

// The largest coordinate of a face's corners.
double size_of(const Mesh& mesh, FaceId face);
// Of a face: its least height.
double width_of(const Mesh& mesh, FaceId face);
// How far rays from the viewer, or from no farther away, may pass from points of the face where
// they would meet them: 2^-20 of the distance, 16 roundings of a ray's origin, of its direction, of
// corners relative to the origin, and of sums of products of them.
double blur_of(const Mesh& mesh, FaceId face, const Vec3d& viewer);
// How far edges may be from a face to be near to it: its blur, and no more than 2^-8 of its longest
// side: what is farther from the viewer than its rays can tell apart at all is not near to all of
// its like.
double reach_of(const Mesh& mesh, FaceId face, const Vec3d& viewer);
// Whether a face is so narrow that what is near to one of its sides is near to the other one, too.
bool is_needle(const Mesh& mesh, FaceId face, const Vec3d& viewer);

}  // namespace limn
