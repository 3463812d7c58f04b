#pragma once
// Directions along which the displacement parameter moves vertices.
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

// V unit vectors, equal for welded vertices: angle-weighted means of the adjacent face normals,
// also if shading is flat or normals are given. Zero for a vertex without faces.
std::vector<Vec3d> displacement_directions(const Mesh& mesh);

}  // namespace limn
