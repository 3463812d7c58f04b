#pragma once
// The fold between two faces across their common edge.
#include "limn/core/vec.h"

namespace limn {

// Six times the signed volume of the tetrahedron of an edge (a, b) and the far corners c, d of
// its two faces: positive if each face is in front of the other's plane. And a bound of its
// rounding error: a position is rounded to float twice (in the file, and after a rotation or
// scaling about the origin), so it is off by at most 2 * 2^-24 |x|, times the length of the
// volume's gradient.
struct Fold {
  double volume, rounding;
};
inline Fold fold_of(const Vec3d& a, const Vec3d& b, const Vec3d& c, const Vec3d& d) {
  const Vec3d ab = b - a, ac = c - a, ad = d - a;
  const Vec3d by_d = cross(ab, ac), by_c = cross(ad, ab), by_b = cross(ac, ad);
  const double sum = length(by_b + by_c + by_d) * length(a) + length(by_b) * length(b) +
                     length(by_c) * length(c) + length(by_d) * length(d);
  return {dot(by_d, ad), 0x1.0p-23 * sum};
}

}  // namespace limn
