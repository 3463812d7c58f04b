#pragma once
// Closed surfaces of functions.
#include <functional>

#include "tools/generate/generate.h"

namespace limn {

struct Implicit {
  // Negative inside, smooth, roughly a distance; positive on the boundary of the box.
  std::function<double(const Vec3d&)> value;
  Vec3d lower, upper;
};

// The surface value = 0 by surface nets (Gibson 1998) over cubes of side h: a vertex in every cube
// that the surface passes, a quad around every side of a cube that it crosses. The vertices are
// then spread evenly over the surface, and the quads cut along their shorter diagonals.
Triangles polygonise(const Implicit& surface, double h);

// Distance to a round cone: from a sphere of radius r_a around a to one of radius r_b around b,
// radii going linearly along the segment (exactly a distance where they are equal).
struct Bone {
  Vec3d a, b;
  double r_a, r_b;
  double distance(const Vec3d& p) const;
};

// -width log sum exp(-d_i / width): the union of the bones with joints rounded over about `width`.
double blend(const std::vector<Bone>& bones, double width, const Vec3d& p);

}  // namespace limn
