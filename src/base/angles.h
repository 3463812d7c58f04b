#pragma once
// Fast trigonometric functions for inner loops, exact to a few units in the last place. The maths
// library spends several times as long on arguments that never occur here.
#include <bit>
#include <cmath>
#include <cstdint>

#include "limn/core/dual.h"
#include "src/base/wide.h"

namespace limn {

// a + b t + c t^2 + ...
template <int N, class T>
[[gnu::always_inline]] inline T polynomial(const double (&coefficients)[N], const T& t) {
  T sum = coefficients[N - 1];
  for (int i = N - 2; i >= 0; --i) sum = sum * t + coefficients[i];
  return sum;
}

namespace detail {
// Two numbers, the second unused: a vector select avoids branches, which are mispredicted half of
// the time for random directions.
using Pair [[gnu::vector_size(16)]] = double;
using Bits [[gnu::vector_size(16)]] = int64_t;
}  // namespace detail

// a > b ? more : other, without a branch.
inline double choose_above(double a, double b, double more, double other) {
  using detail::Pair;
  return (Pair{a} > Pair{b} ? Pair{more} : Pair{other})[0];
}

// atan2(y, x), finite and not both 0 (then 0); in [-pi, pi], without branches. T: double, or
// wide::Doubles.
template <class T>
[[gnu::always_inline]] inline T angle_of(const T& y, const T& x) {
  using std::copysign, std::fabs;
  // (atan(z) / z - 1) / z^2 in z^2 up to tan(pi / 8)^2, at Chebyshev nodes: error 7e-18.
  constexpr double kAtan[] = {-0x1.5555555555555p-2, 0x1.999999999934ap-3,  -0x1.24924924360cbp-3,
                              0x1.c71c7185314cbp-4,  -0x1.745d0b26b83e7p-4, 0x1.3b1262d95579ep-4,
                              -0x1.10fa75382537fp-4, 0x1.dfe61e80903d2p-5,  -0x1.a098bb6ba4941p-5,
                              0x1.41603647c7a7cp-5,  -0x1.3a2b7a07caea9p-6};
  constexpr double kTanEighth = 0.41421356237309505;
  const T ax = fabs(x), ay = fabs(y);
  const T large = choose_above(ax, ay, ax, ay), small = choose_above(ax, ay, ay, ax);
  // Beyond this, atan(q) = pi / 4 + atan((q - 1) / (q + 1)).
  const T limit = kTanEighth * large;
  const T numerator = choose_above(small, limit, small - large, small);
  const T denominator = choose_above(small, limit, small + large, large);
  const T z = choose_above(denominator, T(0.0), numerator / denominator, T(0.0));
  const T z2 = z * z;
  const T turned = choose_above(small, limit, T(kPi / 4), T(0.0));
  T angle = turned + (z + z * (z2 * polynomial(kAtan, z2)));
  angle = choose_above(ay, ax, kPi / 2 - angle, angle);
  angle = choose_above(T(0.0), copysign(T(1.0), x), kPi - angle, angle);
  return copysign(angle, y);
}
inline Dual angle_of(const Dual& y, const Dual& x) {
  const double r2 = x.v * x.v + y.v * y.v;
  return {angle_of(y.v, x.v), r2 > 0 ? (y.d * x.v - x.d * y.v) / r2 : Lanes{}};
}

namespace detail {
// sin(2 pi r) / r and cos(2 pi r) in r^2 up to 1/64, at Chebyshev nodes: errors 3e-17 and 2e-17.
inline constexpr double kSin[] = {
    0x1.921fb54442d18p+2, -0x1.4abbce625be41p+5, 0x1.466bc677587f8p+6, -0x1.32d2cce2e5b19p+6,
    0x1.50782fda12d96p+5, -0x1.e30071afc3e59p+3, 0x1.e3f38399551bfp+1};
inline constexpr double kCos[] = {
    0x1.0000000000000p+0, -0x1.3bd3cc9be45dep+4, 0x1.03c1f081b5aacp+6, -0x1.55d3c7e3c90f8p+6,
    0x1.e1f5068355e15p+5, -0x1.a6d1ec7906c20p+4, 0x1.f9cc41140bb60p+2, -0x1.b264ba152378ap+0};
}  // namespace detail

template <class T>
struct SinCosOf {
  T sin, cos;
};
using SinCos = SinCosOf<double>;
// Sine and cosine of an angle in turns, 0 to 1.5.
inline SinCos sin_cos_of_turns(double turns) {
  const int quarter = static_cast<int>(4 * turns + 0.5);
  const double r = turns - 0.25 * quarter, r2 = r * r;
  const double s = r * polynomial(detail::kSin, r2), c = polynomial(detail::kCos, r2);
  const int64_t odd = -int64_t{quarter & 1};
  detail::Pair both = detail::Bits{odd, odd} ? detail::Pair{c, s} : detail::Pair{s, c};
  both = std::bit_cast<detail::Pair>(
      std::bit_cast<detail::Bits>(both) ^
      detail::Bits{int64_t{quarter & 2} << 62, int64_t{(quarter + 1) & 2} << 62});
  return {both[0], both[1]};
}
[[gnu::always_inline]] inline SinCosOf<wide::Doubles> sin_cos_of_turns(const wide::Doubles& turns) {
  using wide::Doubles, wide::Mask, wide::RawDoubles;
  const wide::Ints quarter = wide::truncated(4 * turns + 0.5);
  const Doubles r = turns - 0.25 * wide::to_doubles(quarter), r2 = r * r;
  const Doubles s = r * polynomial(detail::kSin, r2), c = polynomial(detail::kCos, r2);
  const Mask quarters = __builtin_convertvector(quarter, Mask), odd = -(quarters & 1);
  const auto turned = [](const Doubles& a, const Mask& half) {
    return Doubles((RawDoubles)((Mask)a.v ^ (half & 2) << 62));
  };
  return {turned(select(odd, c, s), quarters), turned(select(odd, s, c), quarters + 1)};
}

}  // namespace limn
