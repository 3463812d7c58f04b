#pragma once
// Eight numbers in a SIMD vector (extension of GCC and Clang), one per path of a batch. Arithmetic
// is element-wise: an element's result does not depend on the others, which may hold anything.
// Without wide registers the compiler splits vectors; the steps per element are the same.
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "limn/core/vec.h"

// The calling convention of vectors varies: never pass them by value between files.
#pragma GCC diagnostic ignored "-Wpsabi"

namespace limn::wide {

inline constexpr int kWidth = 8;

using RawDoubles [[gnu::vector_size(8 * kWidth)]] = double;
using Mask [[gnu::vector_size(8 * kWidth)]] = int64_t;  // -1 where true, else 0
using Words [[gnu::vector_size(8 * kWidth)]] = uint64_t;
using Ints [[gnu::vector_size(4 * kWidth)]] = int32_t;
using HalfWords [[gnu::vector_size(4 * kWidth)]] = uint32_t;

// A class, so that templates over a scalar find its functions.
struct Doubles {
  RawDoubles v{};

  Doubles() = default;
  [[gnu::always_inline]] Doubles(double a) : v(a - RawDoubles{}) {}  // NOLINT: as for any scalar
  [[gnu::always_inline]] explicit Doubles(const RawDoubles& raw) : v(raw) {}
  double operator[](int i) const { return v[i]; }
};
using Vec = Vec3<Doubles>;

#define LIMN_WIDE [[gnu::always_inline]] inline

LIMN_WIDE Doubles operator+(const Doubles& a, const Doubles& b) { return Doubles(a.v + b.v); }
LIMN_WIDE Doubles operator-(const Doubles& a, const Doubles& b) { return Doubles(a.v - b.v); }
LIMN_WIDE Doubles operator*(const Doubles& a, const Doubles& b) { return Doubles(a.v * b.v); }
LIMN_WIDE Doubles operator/(const Doubles& a, const Doubles& b) { return Doubles(a.v / b.v); }
LIMN_WIDE Doubles operator-(const Doubles& a) { return Doubles(-a.v); }
LIMN_WIDE Mask operator<(const Doubles& a, const Doubles& b) { return a.v < b.v; }
LIMN_WIDE Mask operator>(const Doubles& a, const Doubles& b) { return a.v > b.v; }

// a where the mask is true, else b.
LIMN_WIDE Doubles select(const Mask& mask, const Doubles& a, const Doubles& b) {
  return Doubles(mask ? a.v : b.v);
}
LIMN_WIDE Ints select(const Mask& mask, const Ints& a, const Ints& b) {
  return __builtin_convertvector(mask, Ints) ? a : b;
}
LIMN_WIDE Doubles choose_above(const Doubles& a, const Doubles& b, const Doubles& more,
                               const Doubles& other) {
  return select(a > b, more, other);
}
// If an element of a or b is NaN, the result is b's.
LIMN_WIDE Doubles min(const Doubles& a, const Doubles& b) { return select(a < b, a, b); }
LIMN_WIDE Doubles max(const Doubles& a, const Doubles& b) { return select(a > b, a, b); }
LIMN_WIDE Ints min(const Ints& a, const Ints& b) { return a < b ? a : b; }

LIMN_WIDE Doubles sqrt(const Doubles& a) {
  Doubles r;
  for (int i = 0; i < kWidth; ++i) r.v[i] = std::sqrt(a.v[i]);
  return r;
}
LIMN_WIDE Doubles fabs(const Doubles& a) { return Doubles((RawDoubles)((Mask)a.v & INT64_MAX)); }
LIMN_WIDE Doubles copysign(const Doubles& size, const Doubles& sign) {
  return Doubles((RawDoubles)(((Mask)size.v & INT64_MAX) | ((Mask)sign.v & INT64_MIN)));
}

// Towards zero; within the range of 32 bits.
LIMN_WIDE Ints truncated(const Doubles& a) { return __builtin_convertvector(a.v, Ints); }
LIMN_WIDE Doubles to_doubles(const Ints& a) {
  return Doubles(__builtin_convertvector(a, RawDoubles));
}

// Element i: of(i), read one at a time. A wide load would stall on preceding narrow
// stores.
template <class F>
LIMN_WIDE Doubles gather(const F& of) {
  return Doubles(RawDoubles{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)});
}
template <class F>
LIMN_WIDE Ints gather_ints(const F& of) {
  return Ints{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
}
// Element i: *of(i).
template <class F>
LIMN_WIDE Vec gather_vectors(const F& of) {
  return {gather([&](int i) { return of(i)->x; }), gather([&](int i) { return of(i)->y; }),
          gather([&](int i) { return of(i)->z; })};
}
// One division: three vector divisions would take as long as most code around them.
LIMN_WIDE Vec normalize(const Vec& a) { return a * (1 / sqrt(dot(a, a))); }
LIMN_WIDE Vec3d lane(const Vec& a, int i) { return {a.x[i], a.y[i], a.z[i]}; }

// Calls f(first, last) for every kWidth of `count` items, fewer at the end.
template <class F>
LIMN_WIDE void for_blocks(size_t count, const F& f) {
  for (size_t first = 0; first < count; first += kWidth) {
    f(first, first + kWidth < count ? first + kWidth : count);
  }
}

}  // namespace limn::wide
