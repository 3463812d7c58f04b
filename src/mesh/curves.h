#pragma once
// Curves with a radius, as tubes of triangles.
#include <span>
#include <string>
#include <vector>

#include "limn/core/matrix.h"
#include "src/mesh/mesh_build.h"

namespace limn {

struct ControlPoint {
  Vec3d p;
  double radius;  // not negative
};
using Curve = std::vector<ControlPoint>;

// Control points, four numbers a line (x y z radius); an empty line begins a new curve. Points are
// transformed, radii are not, as in Mitsuba. InputError for other text, numbers that are not
// finite, negative radii, and curves of fewer than `least` points.
std::vector<Curve> parse_curves(const std::string& file, size_t least, const Matrix4& to_world);

// Tubes about uniform cubic B-splines, open at their ends, with interpolated normals. Texture
// coordinates: u turns about the curve, v runs along the segments of all curves.
RawMesh make_spline_tubes(std::span<const Curve> curves);

// Cones that touch the spheres about each two neighbours, and these spheres: round joints and ends.
// Segments are pieces of their own, which begin inside of the sphere that ends the one before.
RawMesh make_linear_tubes(std::span<const Curve> curves);

}  // namespace limn
