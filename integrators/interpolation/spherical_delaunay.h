#pragma once
// The Delaunay triangles of points on the sphere, whose dual is their Voronoi diagram.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

// Facets of the convex hull of unit vectors, all different, as indices; points are shifted by 1e-7
// so that no four lie on one circle. None for fewer than four points.
std::vector<std::array<uint32_t, 3>> spherical_delaunay(std::span<const Vec3d> points);

}  // namespace limn
