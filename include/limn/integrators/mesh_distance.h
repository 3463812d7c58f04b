#pragma once
// How far a fitted mesh is from the true one, and what is wrong with it by itself.
#include <cstdint>
#include <optional>

#include "limn/core/mesh.h"

namespace limn {

// Of points spread evenly over either surface to the nearest point of the other one, in scene
// units. The mean of both directions, but for `hausdorff`.
struct MeshDistance {
  double chamfer = 0;       // mean distance
  double hausdorff_95 = 0;  // distance that 95 % of the points do not exceed, the larger direction
  double hausdorff = 0;     // largest distance, the larger direction
  double normal_angle = 0;  // mean angle between the faces' normals there [radians]
};
// samples: points on each surface, at least one, stratified by area with the random numbers of
// `seed`. The result does not depend on `threads`. InputError if a mesh has no face with an
// area.
MeshDistance mesh_distance(const Mesh& mesh, const Mesh& truth, size_t samples, uint64_t seed,
                           int threads);

// Faces whose front is not outside: parts that are turned inside out or lie within others, by the
// winding number right before each face's center. Nothing for meshes with borders, where there is
// no outside.
std::optional<size_t> count_inside_out(const Mesh& mesh, int threads);

// Pairs of the mesh's faces that pass through each other (find_intersections).
size_t count_crossings(const Mesh& mesh, int threads);

}  // namespace limn
