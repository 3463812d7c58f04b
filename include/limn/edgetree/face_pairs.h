#pragma once
// Pairs of nearby faces of a scene: a superset of all faces that touch or intersect.
#include <span>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

struct FacePair {
  FaceRef first, second;  // in order of shapes and faces
};

// All pairs of faces whose bounding boxes overlap, each box enlarged by the error of
// float rays at the face (blur_of) and the rounding of positions. Pairs with a common
// corner are omitted if the faces around it form a closed fan that covers directions
// once, seen along their mean normal: these share no other point. meshes: of the scene's
// shapes, in order, with weld filled. The order of pairs is unspecified but does not
// depend on `threads`.
std::vector<FacePair> find_face_pairs(std::span<const Mesh* const> meshes, const Vec3d& viewer,
                                      int threads);

// The largest coordinate of a face's corners.
double size_of(const Mesh& mesh, FaceId face);
// The smallest height of a face.
double width_of(const Mesh& mesh, FaceId face);
// Distance at which rays from the viewer, or from closer, may miss a point of the face where they
// should hit it: 2^-20 of the viewer's distance, for 16 roundings of the ray's origin and
// direction, of relative corners, and of sums of products of them.
double blur_of(const Mesh& mesh, FaceId face, const Vec3d& viewer);
// Largest distance of an edge that counts as near to a face: the face's blur_of, but at most 2^-8
// of its longest side. Otherwise far small faces, which rays cannot resolve, would all be near to
// one another.
double reach_of(const Mesh& mesh, FaceId face, const Vec3d& viewer);
// True if a face is so narrow that what is near to one of its sides is near to another, too.
bool is_needle(const Mesh& mesh, FaceId face, const Vec3d& viewer);

}  // namespace limn
