// Lambert's formula, and quadrature over polygons of directions: points, and where integrands have
// kinks.
#include "integrators/lights/polygon_light.h"

namespace limn::detail {
namespace {

constexpr int kPoints = 8;

// By Newton's method from Chebyshev's points.
std::array<QuadraturePoint, kPoints> gauss_legendre() {
  std::array<QuadraturePoint, kPoints> points;
  for (int i = 0; i < kPoints; ++i) {
    double x = std::cos(kPi * (i + 0.75) / (kPoints + 0.5)), slope = 0;
    for (int step = 0; step < 20; ++step) {
      double p = 1, before = 0;
      for (int n = 1; n <= kPoints; ++n) {
        const double next = ((2 * n - 1) * x * p - (n - 1) * before) / n;
        before = p;
        p = next;
      }
      slope = kPoints * (x * p - before) / (x * x - 1);
      x -= p / slope;
    }
    points[i] = {0.5 * (1 - x), 1 / ((1 - x * x) * slope * slope)};
  }
  return points;
}

}  // namespace

std::span<const QuadraturePoint> quadrature() {
  static const std::array<QuadraturePoint, kPoints> points = gauss_legendre();
  return points;
}

// With w = a + t d: (axis . w)^2 = level^2 w . w, where axis . w has the level's sign.
Breaks::Breaks(const Vec3d& a, const Vec3d& b, std::span<const Kink> kinks) {
  const Vec3d d = b - a;
  at[count++] = 0;
  for (const Kink& kink : kinks) {
    const double p = dot(kink.axis, a), q = dot(kink.axis, d), l = kink.level * kink.level;
    const double aa = q * q - l * dot(d, d), bb = p * q - l * dot(a, d), cc = p * p - l * dot(a, a);
    const auto add = [&](double t) {
      if (t > 0 && t < 1 && (p + q * t) * kink.level >= 0) at[count++] = t;
    };
    if (kink.level == 0) {
      if (q != 0) add(-p / q);
      continue;
    }
    const double discriminant = bb * bb - aa * cc;
    if (discriminant < 0) continue;
    const double root = -bb - std::copysign(std::sqrt(discriminant), bb);
    if (aa != 0) add(root / aa);
    if (root != 0) add(cc / root);
  }
  std::sort(at.begin() + 1, at.begin() + count);
  at[count++] = 1;
}

}  // namespace limn::detail

namespace limn {
namespace {

// The integral of (n . w) w / |N| along a side, whose product with dN is what its motion adds.
Vec3d cosine_slope(const detail::Arc& arc, const Vec3d& n) {
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
    const detail::Arc arc(value(side.normal), side.begin, side.end);
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

namespace {

// c times the ramp, its integral G from c to 1, and that one's derivative with respect to h.
struct Ramp {
  explicit Ramp(double horizon) : h(horizon), end(h * (2 - h)), width(h * (1 - h)) {}
  double value(double c) const { return c <= h ? 0 : c >= end ? c : c * (c - h) / width; }
  double integral(double c) const {
    if (c >= end) return 0.5 * (1 - c * c);
    const double from = std::max(c, h);
    return 0.5 * (1 - end * end) +
           ((end * end * end - from * from * from) / 3 - 0.5 * h * (end * end - from * from)) /
               width;
  }
  // On the ramp its height's derivative is -1 / width - (c - h) (1 - 2 h) / width^2.
  double integral_by_h(double c) const {
    if (c >= end) return 0;
    const double from = std::max(c, h), bend = (1 - 2 * h) / (width * width);
    const double squares = 0.5 * (end * end - from * from),
                 cubes = (end * end * end - from * from * from) / 3;
    return -squares / width - bend * (cubes - h * squares);
  }
  double h, end, width;
};

// visit(w, dpsi): points along a side, with their signed weights.
template <class Visit>
void for_every_direction(const detail::Arc& arc, const Vec3d& a, const Vec3d& b,
                         std::span<const Kink> kinks, const Visit& visit, int depth = 0) {
  constexpr double kWide = 0.5;  // not tuned
  if (length(b - a) > kWide && depth < 12) {
    const Vec3d m = normalize(a + b);
    for_every_direction(arc, a, m, kinks, visit, depth + 1);
    for_every_direction(arc, m, b, kinks, visit, depth + 1);
    return;
  }
  const double area = dot(arc.s, cross(a, b));
  detail::for_every_point(detail::Breaks(a, b, kinks), [&](double t, double weight) {
    const Vec3d w = a + (b - a) * t;
    const double size = length(w);
    visit(w / size, weight * area / (size * size));
  });
}

// 1 - c^2 as the square of a sine, without cancellation.
double squared_sine(const Vec3d& n, const Vec3d& w) { return length_squared(cross(n, w)); }

// Where n turns with the angular velocity r, the polygon turns back with -r; with r = n x dn
// -(r x s) . w is (dn . s) (n . w) - (n . s) (dn . w): the slope by n of what a side adds, over the
// value of the ramp.
Vec3d turned_back(const detail::Arc& arc, const Vec3d& n, const Vec3d& w) {
  return arc.s * dot(n, w) - w * dot(n, arc.s);
}

// An integral, and its slopes by the ramp's begin and the normal.
struct RampSums {
  double value = 0, by_h = 0;
  Vec3d by_n;
};
// 0 < h < 1. add_side(side, slope): by the normal of a side.
template <class S, class AddSide>
RampSums ramp_sums(std::span<const PolygonSide<S>> sides, const Vec3d& n, double h,
                   const AddSide& add_side) {
  const Ramp ramp(h);
  const std::array<Kink, 2> kinks = {{{n, ramp.h}, {n, ramp.end}}};
  RampSums sums;
  for (const PolygonSide<S>& side : sides) {
    const detail::Arc arc(value(side.normal), side.begin, side.end);
    for_every_direction(arc, side.begin, side.end, kinks, [&](const Vec3d& w, double dpsi) {
      const double c = dot(n, w), across = dot(n, arc.s) * dpsi;
      if (c >= ramp.end) {
        sums.value += 0.5 * across;
      } else {
        const double over = across / squared_sine(n, w);
        sums.value += ramp.integral(c) * over;
        sums.by_h += ramp.integral_by_h(c) * over;
      }
      const double weight = ramp.value(c) * dpsi;
      if (weight == 0) return;
      sums.by_n += turned_back(arc, n, w) * weight;
      add_side(side, w * (weight / arc.length));
    });
  }
  return sums;
}

}  // namespace

double ramp_integral(std::span<const PolygonSide<double>> sides, const Vec3d& n, double h) {
  if (h == 0) return cosine_integral(sides, n);
  if (h >= 1) return 0;
  return ramp_sums(sides, n, h, [](const auto&, const Vec3d&) {}).value;
}

Dual ramp_integral(std::span<const PolygonSide<Dual>> sides, const Vec3<Dual>& normal,
                   const Dual& h) {
  if (h.v == 0) return cosine_integral(sides, normal);  // the derivative by h is 0 there
  if (h.v >= 1) return {};
  Dual result;
  const RampSums sums = ramp_sums(
      sides, value(normal), h.v,
      [&](const auto& side, const Vec3d& slope) { result.d += dot(side.normal, slope).d; });
  result.v = sums.value;
  result.d += h.d * sums.by_h + dot(normal, sums.by_n).d;
  return result;
}

// One statement of the tape.
Var ramp_integral(std::span<const PolygonSide<Var>> sides, const Vec3<Var>& normal, const Var& h) {
  if (h.v == 0) return cosine_integral(sides, normal);  // the derivative by h is 0 there
  if (h.v >= 1) return {};
  Tape& tape = *Tape::current();
  const RampSums sums = ramp_sums(
      sides, value(normal), h.v,
      [&](const auto& side, const Vec3d& slope) { detail::add_entries(tape, side.normal, slope); });
  detail::add_entries(tape, normal, sums.by_n);
  tape.entry(h.node, sums.by_h);
  return {sums.value, tape.end()};
}

}  // namespace limn
