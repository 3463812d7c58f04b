#pragma once
// Stored form of a pair of bounding quadrics in the coordinates of a dual box, and the test
// whether planes through a point may lie between them (Soroka, Peters, Marschner 2025, Sec. 3.3
// and 3.4).
//
// With Q_o = D D^T and D along the box's Z, the planes between Q_0 and Q_1 satisfy low <= f(u) <=
// high, where f is a quadratic polynomial in the box's coordinates u. The paper's lambda(q) is -(q
// . Q_f q) / (D . q)^2, and D . q is constant over the box. So ten coefficients and two bounds
// replace two matrices; the constant is part of the bounds.
#include <limits>

#include "edgetree/bounds/lanes.h"

namespace limn {

// f(u) = sum of linear_k u_k + square_k u_k^2 + product_k u_i u_j, with i, j the indices other than
// k. In each element the moduli of the coefficients sum to 1, or all are 0 (with infinite bounds:
// never rejects).
struct QuadricPairs {
  FourFloats linear[3], square[3], product[3];
  FourFloats low, high;
};

// One element of QuadricPairs: linear, square, product as floats. The default never rejects.
struct PairFit {
  float coefficients[9] = {};
  float low = -std::numeric_limits<float>::infinity();
  float high = std::numeric_limits<float>::infinity();
};
void put_pair(const PairFit& fit, int lane, QuadricPairs& pairs);

// The query plane g_0 + g_1 u_0 + g_2 u_1 + g_3 u_2 = 0 of each child, and a bound of the error of
// its left side from rounding and `distance_error`.
struct QueryPlanes {
  Doubles g[4];
  double error;
};

// True where the dual box [-1, 1]^3 meets the query plane, up to its error.
Longs meet_box(const QueryPlanes& planes);

// True where f may have a value in [low, high] on the intersection polygon of query plane and
// box. The polygon is connected, so these values form an interval. Its ends are at a corner, at
// the vertex of a parabola on a side, or at the critical point inside: the three conditions of
// Sec. 3.4 and the conic of Appendix C. Conservative: nonzero if some u in the box has |g(u)| <=
// error and low <= f(u) <= high (proof above the code). Undefined for children that do not meet
// the box.
Longs meet_pair(const QuadricPairs& pairs, const QueryPlanes& planes);

}  // namespace limn
