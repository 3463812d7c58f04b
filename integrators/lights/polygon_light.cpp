// Lambert's formula for polygons of directions.
#include "integrators/lights/polygon_light.h"

#include <cmath>

namespace limn {
namespace {

// Along a side from `from`, in an orthonormal frame: w = from cos psi + across sin psi.
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

// The integral of (n . w) w / |N| along a side, whose product with dN is what its motion adds.
Vec3d cosine_slope(const Arc& arc, const Vec3d& n) {
  // n . w as c cos psi + d sin psi, and the integrals of its products with cos psi and sin psi.
  const double c = dot(n, arc.start), d = dot(n, arc.across);
  const double sine = std::sin(arc.angle), both = 0.5 * sine * sine;
  const double twice = 0.5 * sine * std::cos(arc.angle);
  const double cosines = 0.5 * arc.angle + twice, sines = 0.5 * arc.angle - twice;
  return (arc.start * (c * cosines + d * both) + arc.across * (c * both + d * sines)) *
         (1 / arc.length);
}

// The sum of angle s / 2 over the sides. add_side(side, slope): by the normal of a side that moves.
template <class S, class AddSide>
Vec3d half_angles(std::span<const PolygonSide<S>> sides, const Vec3d& n, const AddSide& add_side) {
  Vec3d sum;
  for (const PolygonSide<S>& side : sides) {
    const Arc arc(value(side.normal), side.begin, side.end);
    sum += arc.s * (0.5 * arc.angle);
    if constexpr (!std::is_same_v<S, double>) {
      if (!is_constant(side.normal)) add_side(side, cosine_slope(arc, n));
    }
  }
  return sum;
}

}  // namespace

double cosine_integral(std::span<const PolygonSide<double>> sides, const Vec3d& n) {
  return dot(n, half_angles(sides, n, [](const auto&, const Vec3d&) {}));
}

Dual cosine_integral(std::span<const PolygonSide<Dual>> sides, const Vec3<Dual>& n) {
  Dual moved;
  const Vec3d sum = half_angles(sides, value(n), [&](const auto& side, const Vec3d& slope) {
    moved.d += dot(side.normal, slope).d;
  });
  return dot(n, sum) + moved;
}

// One statement of the tape.
Var cosine_integral(std::span<const PolygonSide<Var>> sides, const Vec3<Var>& n) {
  Tape& tape = *Tape::current();
  const Vec3d sum = half_angles(sides, value(n), [&](const auto& side, const Vec3d& slope) {
    detail::add_entries(tape, side.normal, slope);
  });
  detail::add_entries(tape, n, sum);
  return {dot(value(n), sum), tape.end()};
}

}  // namespace limn
