#pragma once
// Integrals over polygons of directions, and their derivatives by the motion of the polygon's
// sides: no corner is differentiated, after
//   d/dtheta of the integral of f over P = that of df/dtheta + sum over sides of
//                                          the integral of f (dN . w) / |N| dpsi,
// with N the normal of the plane through the side, positive inside, and psi the angle along it.
#include <span>

#include "limn/core/dual.h"
#include "limn/core/var.h"
#include "limn/core/vec.h"

namespace limn {

// A side of a polygon of directions as seen from a point, or a piece of one. The polygon is to the
// left, seen from that point; the sides of all its borders together are closed, in any order.
template <class S>
struct PolygonSide {
  Vec3<S> normal;    // of the plane through the point and the side; of any length, positive inside
  Vec3d begin, end;  // unit
};

// The integral of n . w over the polygon [sr]: Lambert's formula, n . sum of angle s / 2. n: of any
// length; below its horizon n . w counts as negative.
double cosine_integral(std::span<const PolygonSide<double>> sides, const Vec3d& n);
Dual cosine_integral(std::span<const PolygonSide<Dual>> sides, const Vec3<Dual>& n);
Var cosine_integral(std::span<const PolygonSide<Var>> sides, const Vec3<Var>& n);

namespace detail {

// Of a statement of the tape: what three nodes add to its result.
inline void add_entries(Tape& tape, const Vec3<Var>& x, const Vec3d& slope) {
  for (int k = 0; k < 3; ++k) tape.entry(x[k].node, slope[k]);
}

}  // namespace detail

}  // namespace limn
