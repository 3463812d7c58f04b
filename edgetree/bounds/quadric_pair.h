#pragma once
// A pair of bounding quadrics in the coordinates of a dual box: what is stored of it, and whether
// the planes through a point meet it (Soroka, Peters, Marschner 2025, Sec. 3.3 and 3.4).
//
// With Q_o = D D^T and D along the box's Z, the planes of the family between Q_0 and Q_1 are those
// of the slab low <= f(u) <= high, f being a quadratic polynomial of the box's coordinates u:
// lambda(q) of the paper is -(q . Q_f q) / (D . q)^2, and D . q is the same for all points of the
// box. So ten coefficients and two bounds stand for two matrices, and the constant is in the
// bounds.
#include <limits>

#include "edgetree/bounds/lanes.h"

namespace limn {

// f(u) = sum of linear_k u_k + square_k u_k^2 + product_k u_i u_j, with i, j the two others than k.
// The moduli of a lane's coefficients add up to 1, or all are 0 (with infinite bounds: never
// rejects).
struct QuadricPairs {
  FourFloats linear[3], square[3], product[3];
  FourFloats low, high;
};

// One lane of these: linear, square, product, exactly floats. By default it rejects nothing.
struct PairFit {
  float coefficients[9] = {};
  float low = -std::numeric_limits<float>::infinity();
  float high = std::numeric_limits<float>::infinity();
};
void put_pair(const PairFit& fit, int lane, QuadricPairs& pairs);

// The query plane g_0 + g_1 u_0 + g_2 u_1 + g_3 u_2 = 0 of each lane, and a bound of what rounding
// and `distance_error` can add to its left side.
struct QueryPlanes {
  Doubles g[4];
  double error;
};

// Whether the dual box [-1, 1]^3 meets the query plane, to its error.
Longs meet_box(const QueryPlanes& planes);

// Whether f takes a value of [low, high] on the polygon in which the query plane cuts the box. The
// polygon is connected, so the values of f on it are an interval, whose ends are at a corner, at a
// parabola's vertex on a side, or at the critical point inside: which the three conditions of Sec.
// 3.4 and the conic of Appendix C ask one by one. Lanes that do not meet the box may be either.
// Never 0 for a lane where some u in the box has |g(u)| <= error and low <= f(u) <= high; the proof
// stands above the code.
Longs meet_pair(const QuadricPairs& pairs, const QueryPlanes& planes);

}  // namespace limn
