#pragma once
// Tangents of a surface: the directions of growing u, for roughness and maps that have a direction.
#include <memory>
#include <vector>

#include "limn/core/mesh.h"

namespace limn {

class Texture;

// A texture whose value at a point is the direction of growing u there: in world space, of any
// length, neither unit nor orthogonal to the normal; 0 where uv has none. It reads
// Mesh::u_directions.
std::shared_ptr<Texture> make_tangent();

// A texture whose value is the geometric normal, of any length.
std::shared_ptr<Texture> make_outward();
// A texture whose value is the gradient of a texture of numbers along the surface [1 / scene unit],
// in world space. It has no parameters and its derivatives are taken as 0.
std::shared_ptr<Texture> make_surface_gradient(std::shared_ptr<Texture> heights);

// Fills u_ids, u_directions and u_tangents of meshes that have tangents (nothing for others), after
// a change of positions; the second after one of position_tangents alone.
void update_u_directions(Mesh& mesh);
void update_u_tangents(Mesh& mesh);

// The adjoint of update_u_directions. Input: derivatives of a scalar with respect to u_directions.
// Adds its derivatives with respect to positions to `positions` (V), at the first copy of each
// welded vertex.
void pull_back_u_directions(const Mesh& mesh, const std::vector<Vec3d>& directions,
                            std::vector<Vec3d>& positions);

}  // namespace limn
