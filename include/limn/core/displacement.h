#pragma once
// Where vertices go that are displaced along their normals.
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

// V unit vectors, the same for welded vertices: the angle-weighted means of the normals of the
// faces around them, also where shading is flat or normals are given. 0 for vertices of no face.
std::vector<Vec3d> displacement_directions(const Mesh& mesh);

}  // namespace limn
