// The range of a quadratic polynomial over the intersection polygon of a plane and a box, for
// four children at once. Proof that the test is conservative:
//
// Let u be a point of the box with |g(u)| <= error, and G the largest of |g_1|, |g_2|, |g_3|.
// Moving u along the axis of G by at most reach = error / G leads to a point v of the plane in
// the widened box |v_k| <= side = 1 + reach + kMargin. So it suffices to find the range of f over
// the polygon C of that box and to widen it by |f(u) - f(v)| <= 2 side reach, as the moduli of
// the coefficients sum to 1. If reach exceeds kFar, nothing is rejected.
//
// Rounding of doubles: C is convex with at most six sides and contains a disc of radius kMargin /
// 2 around v. Sort the axes by |g| and solve the plane for the axis of G: u_2 = alpha + beta_0
// u_0 + beta_1 u_1 with |beta| <= 1 and |alpha| <= 4. Then f becomes a polynomial phi of two
// variables with coefficients of at most 16, evaluated with the error 2^-44. C is the square of
// half-width `side` between two lines. The ends of its sides are divided by beta_0 or beta_1,
// taken to be at least kSteep: this moves u_2 by 2^-33, and the ends are exact to 2^-52 * 8 /
// kSteep = 2^-15. Inexact ends still lie in C to 2^-33 (only their position along the side is
// ill-conditioned). The gap between the ends of neighbouring sides is at most 2^-14 long; a
// parabola with known ends exceeds them there by at most 2^-26. Vertices and the critical point
// are evaluated at their computed positions, which is harmless inside of C; where an
// ill-conditioned division misses them, the curvature is below 2^-26, and f is flat to that. All
// errors are far below kSlack.
#include "edgetree/bounds/quadric_pair.h"

#include <initializer_list>
#include <limits>

namespace limn {
namespace {

constexpr double kMargin = 0x1.0p-20;
constexpr double kFar = 0.25;
constexpr double kSteep = 0x1.0p-34;
constexpr double kSlack = 0x1.0p-22;

void exchange(Longs swap, Doubles& a, Doubles& b) {
  const Doubles c = select(swap, b, a);
  b = select(swap, a, b);
  a = c;
}

// f and the plane, with axes sorted by |g|, the largest last.
struct Sorted {
  Doubles g[3], linear[3], square[3], product[3];

  Sorted(const QuadricPairs& pairs, const QueryPlanes& planes) {
    for (int k = 0; k < 3; ++k) {
      g[k] = planes.g[k + 1];
      linear[k] = widen(pairs.linear[k]);
      square[k] = widen(pairs.square[k]);
      product[k] = widen(pairs.product[k]);
    }
    order(0, 1);
    order(1, 2);
    order(0, 1);
  }

 private:
  void order(int i, int j) {
    const Longs swap = abs(g[i]) > abs(g[j]);
    exchange(swap, g[i], g[j]);
    exchange(swap, linear[i], linear[j]);
    exchange(swap, square[i], square[j]);
    exchange(swap, product[i], product[j]);
  }
};

struct Range {
  Doubles low = splat4(std::numeric_limits<double>::infinity());
  Doubles high = -low;
  void add(Longs valid, Doubles value) {
    low = select(valid & (value < low), value, low);
    high = select(valid & (value > high), value, high);
  }
};

// The parabola c_0 + c_1 t + c_2 t^2 over t in [begin, end].
struct Parabola {
  Doubles c_0, c_1, c_2;
  Doubles operator()(Doubles t) const { return c_0 + t * (c_1 + t * c_2); }
  // half_inverse: 1 / (2 c_2); any value where that is not finite.
  void add_range(Doubles begin, Doubles end, Doubles half_inverse, Range& range) const {
    const Longs valid = begin <= end;
    range.add(valid, (*this)(begin));
    range.add(valid, (*this)(end));
    range.add(valid, (*this)(clamp(-c_1 * half_inverse, begin, end)));
  }
};

Doubles steep(Doubles beta) {
  return select(abs(beta) >= kSteep, beta, select(beta < 0, splat4(-kSteep), splat4(kSteep)));
}

// f on the plane, as a polynomial of the two less steep coordinates s and t: the third is alpha +
// beta_s s + beta_t t.
struct OnPlane {
  Doubles alpha, beta_s, beta_t;
  Doubles c, c_s, c_t, c_ss, c_tt, c_st;
  Doubles side;

  OnPlane(const Sorted& f, Doubles g_0, Doubles half_width) : side(half_width) {
    const Doubles inverse = -1.0 / f.g[2];
    alpha = g_0 * inverse;
    beta_s = f.g[0] * inverse;
    beta_t = f.g[1] * inverse;
    const Doubles slope = f.linear[2] + 2.0 * f.square[2] * alpha;
    c = alpha * (f.linear[2] + f.square[2] * alpha);
    c_s = f.linear[0] + f.product[1] * alpha + slope * beta_s;
    c_t = f.linear[1] + f.product[0] * alpha + slope * beta_t;
    c_ss = f.square[0] + beta_s * (f.product[1] + f.square[2] * beta_s);
    c_tt = f.square[1] + beta_t * (f.product[0] + f.square[2] * beta_t);
    c_st = f.product[2] + f.product[1] * beta_t + f.product[0] * beta_s +
           2.0 * f.square[2] * beta_s * beta_t;
  }

  void add_inside(Range& range) const {
    const Doubles inverse = 1.0 / (4.0 * c_ss * c_tt - c_st * c_st);
    const Doubles s = (c_st * c_t - 2.0 * c_tt * c_s) * inverse;
    const Doubles t = (c_st * c_s - 2.0 * c_ss * c_t) * inverse;
    const Longs inside =
        (abs(s) <= side) & (abs(t) <= side) & (abs(alpha + beta_s * s + beta_t * t) <= side);
    range.add(inside, c + s * (c_s + c_ss * s + c_st * t) + t * (c_t + c_tt * t));
  }

  // Adds the sides s = +-side and t = +-side, clipped to the range of the third coordinate.
  void add_sides(Range& range) const {
    const Doubles over_s = 1.0 / steep(beta_s), over_t = 1.0 / steep(beta_t);
    const Doubles half_ss = 0.5 / c_ss, half_tt = 0.5 / c_tt;
    for (const double sign : {-1.0, 1.0}) {
      const Doubles at = sign * side;
      Doubles begin, end;
      cut(alpha + beta_s * at, over_t, begin, end);
      Parabola{c + at * (c_s + c_ss * at), c_t + c_st * at, c_tt}.add_range(begin, end, half_tt,
                                                                            range);
      cut(alpha + beta_t * at, over_s, begin, end);
      Parabola{c + at * (c_t + c_tt * at), c_s + c_st * at, c_ss}.add_range(begin, end, half_ss,
                                                                            range);
    }
    add_lines(over_s, over_t, range);
  }

 private:
  // Clips to |offset + beta x| <= side and |x| <= side.
  void cut(Doubles offset, Doubles over_beta, Doubles& begin, Doubles& end) const {
    const Doubles a = (-side - offset) * over_beta, b = (side - offset) * over_beta;
    begin = max(min(a, b), -side);
    end = min(max(a, b), side);
  }

  // Adds the two sides on which the third coordinate is +-side: t = m + n s.
  void add_lines(Doubles over_s, Doubles over_t, Range& range) const {
    const Doubles n = -beta_s * over_t;
    const Doubles c_2 = c_ss + n * (c_st + c_tt * n), half_inverse = 0.5 / c_2;
    for (const double sign : {-1.0, 1.0}) {
      const Doubles level = sign * side - alpha, m = level * over_t;
      // |t| <= side is equivalent to |beta_s s - level| <= |beta_t| side.
      const Doubles wide = side * abs(beta_t);
      const Doubles a = (level - wide) * over_s, b = (level + wide) * over_s;
      const Doubles begin = max(min(a, b), -side), end = min(max(a, b), side);
      Parabola{c + m * (c_t + c_tt * m), c_s + c_st * m + n * (c_t + 2.0 * c_tt * m), c_2}
          .add_range(begin, end, half_inverse, range);
    }
  }
};

}  // namespace

void put_pair(const PairFit& fit, int lane, QuadricPairs& pairs) {
  for (int k = 0; k < 3; ++k) {
    pairs.linear[k][lane] = fit.coefficients[k];
    pairs.square[k][lane] = fit.coefficients[3 + k];
    pairs.product[k][lane] = fit.coefficients[6 + k];
  }
  pairs.low[lane] = fit.low;
  pairs.high[lane] = fit.high;
}

Longs meet_box(const QueryPlanes& planes) {
  return abs(planes.g[0]) <= abs(planes.g[1]) + abs(planes.g[2]) + abs(planes.g[3]) + planes.error;
}

Longs meet_pair(const QuadricPairs& pairs, const QueryPlanes& planes) {
  const Sorted f(pairs, planes);
  const Doubles reach = planes.error / abs(f.g[2]);
  const Doubles side = 1.0 + reach + kMargin;
  const OnPlane phi(f, planes.g[0], side);
  Range range;
  phi.add_sides(range);
  phi.add_inside(range);
  const Doubles slack = 2.0 * side * reach + kSlack;
  // Also true if no side was found or a number is NaN.
  const Longs above = range.low - slack > widen(pairs.high);
  const Longs below = range.high + slack < widen(pairs.low);
  const Longs known = (reach <= kFar) & (range.low <= range.high);
  return ~(known & (above | below));
}

}  // namespace limn
