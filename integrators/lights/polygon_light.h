#pragma once
// Integrals over polygons of directions, and their derivatives by the motion of the polygon's
// sides: no corner is differentiated, after
//   d/dtheta of the integral of f over P = that of df/dtheta + sum over sides of
//                                          the integral of f (dN . w) / |N| dpsi,
// with N the normal of the plane through the side, positive inside, and psi the angle along it.
#include <algorithm>
#include <array>
#include <cmath>
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

namespace detail {

// Along the side from `from`, in an orthonormal frame: w = from cos psi + across sin psi.
struct Arc {
  Arc(const Vec3d& normal, const Vec3d& from, const Vec3d& to)
      : length(limn::length(normal)),
        s(normal / length),
        start(from),
        across(cross(s, from)),
        angle(std::atan2(dot(s, cross(from, to)), dot(from, to))) {}
  double length;  // of the normal that was given
  Vec3d s;        // the same, of length one
  Vec3d start, across;
  double angle;  // signed: negative where the way runs clockwise
};

}  // namespace detail

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

// Directions where a function of direction has a kink: axis . w = level, w of length one.
struct Kink {
  Vec3d axis;
  double level;
};

// The integral over the polygon of c times the ramp that rises from 0 at c = h to 1 at c = h (2 -
// h), c = n . w and h >= 0: what interpolated normals see of a cosine (limn/core/shading.h),
// nothing where h is 1, at a right angle to their face. n: unit. The polygon must not hold -n. With
// G(c) the integral of that from c to 1, by Stokes
//   sum over sides of n . s  the integral of G(c) / (1 - c^2) dpsi,
// the inner one by quadrature between the ends of the ramp.
double ramp_integral(std::span<const PolygonSide<double>> sides, const Vec3d& n, double h);
Dual ramp_integral(std::span<const PolygonSide<Dual>> sides, const Vec3<Dual>& n, const Dual& h);
Var ramp_integral(std::span<const PolygonSide<Var>> sides, const Vec3<Var>& n, const Var& h);

namespace detail {

// Gauss-Legendre points on [0, 1].
struct QuadraturePoint {
  double at, weight;
};
std::span<const QuadraturePoint> quadrature();

// Where the chord from a to b meets kinks, in order, between its ends; the first is 0, the last 1.
struct Breaks {
  static constexpr int kMost = 16;
  Breaks(const Vec3d& a, const Vec3d& b, std::span<const Kink> kinks);
  std::array<double, kMost> at;
  int count = 0;
};

template <class Visit>
void for_every_point(const Breaks& breaks, const Visit& visit) {
  for (int i = 0; i + 1 < breaks.count; ++i) {
    const double from = breaks.at[i], width = breaks.at[i + 1] - from;
    for (const QuadraturePoint& q : quadrature()) visit(from + width * q.at, width * q.weight);
  }
}

// The integral of f over the triangle of three directions, negative if they go round clockwise.
template <class S, class F>
Rgb<S> triangle_integral(const Vec3d& a, const Vec3d& b, const Vec3d& c,
                         std::span<const Kink> kinks, const F& f, int depth = 0) {
  constexpr double kWide = 0.5;  // chords; not tuned
  const double bc = length(c - b), ca = length(a - c), ab = length(b - a);
  const double longest = std::max({bc, ca, ab});
  if (longest > kWide && depth < 12) {
    const auto halves = [&](const Vec3d& x, const Vec3d& y, const Vec3d& z) {
      const Vec3d m = normalize(y + z);
      return triangle_integral<S>(x, y, m, kinks, f, depth + 1) +
             triangle_integral<S>(x, m, z, kinks, f, depth + 1);
    };
    return longest == bc ? halves(a, b, c) : longest == ca ? halves(b, c, a) : halves(c, a, b);
  }
  const double volume = determinant(a, b, c);
  Rgb<S> sum;
  if (volume == 0) return sum;
  for_every_point(Breaks(b, c, kinks), [&](double t, double weight) {
    const Vec3d end = b + (c - b) * t;
    for_every_point(Breaks(a, end, kinks), [&](double s, double inner) {
      const Vec3d w = a + (end - a) * s;
      const double size = length(w);
      sum += f(w / size) * (weight * inner * s * volume / (size * size * size));
    });
  });
  return sum;
}

// The integral of f w / |N| along a side, for each channel.
template <class F>
std::array<Vec3d, 3> side_slopes(const Arc& arc, const Vec3d& a, const Vec3d& b,
                                 std::span<const Kink> kinks, const F& f, int depth = 0) {
  constexpr double kWide = 0.5;  // not tuned
  std::array<Vec3d, 3> sum = {};
  if (length(b - a) > kWide && depth < 12) {
    const Vec3d m = normalize(a + b);
    sum = side_slopes(arc, a, m, kinks, f, depth + 1);
    const std::array<Vec3d, 3> rest = side_slopes(arc, m, b, kinks, f, depth + 1);
    for (int c = 0; c < 3; ++c) sum[c] += rest[c];
    return sum;
  }
  const double area = dot(arc.s, cross(a, b)) / arc.length;
  for_every_point(Breaks(a, b, kinks), [&](double t, double weight) {
    const Vec3d w = a + (b - a) * t;
    const double size = length(w);
    const Rgb<double> here = value(f(w / size));
    for (int c = 0; c < 3; ++c) sum[c] += w * (here[c] * (weight * area / (size * size * size)));
  });
  return sum;
}

inline void add_motion(const Vec3<Dual>& normal, const std::array<Vec3d, 3>& slopes,
                       Rgb<Dual>& sum) {
  for (int c = 0; c < 3; ++c) sum[c].d += dot(normal, slopes[c]).d;
}
inline void add_motion(const Vec3<Var>& normal, const std::array<Vec3d, 3>& slopes, Rgb<Var>& sum) {
  Tape& tape = *Tape::current();
  for (int c = 0; c < 3; ++c) {
    tape.entry(sum[c].node, 1);
    add_entries(tape, normal, slopes[c]);
    sum[c].node = tape.end();
  }
}

}  // namespace detail

// The integral over the polygon of f, a function of unit directions that is smooth but for kinks,
// by quadrature. pole: a unit direction near the polygon.
template <class S, class F>
Rgb<S> polygon_integral(std::span<const PolygonSide<S>> sides, const Vec3d& pole,
                        std::span<const Kink> kinks, const F& f) {
  Rgb<S> sum;
  for (const PolygonSide<S>& side : sides) {
    const Vec3d &a = side.begin, &b = side.end;
    sum += detail::triangle_integral<S>(pole, a, b, kinks, f);
    if constexpr (!std::is_same_v<S, double>) {
      if (is_constant(side.normal)) continue;
      const detail::Arc arc(value(side.normal), a, b);
      detail::add_motion(side.normal, detail::side_slopes(arc, a, b, kinks, f), sum);
    }
  }
  return sum;
}

}  // namespace limn
