#pragma once
// Four doubles in a SIMD vector (extension of GCC and Clang), one per child of a node. Comparisons
// give integer masks: -1 (true) or 0.
#include <cmath>
#include <cstdint>

namespace limn {

inline constexpr int kQuadricWidth = 4;

typedef double Doubles __attribute__((vector_size(8 * kQuadricWidth)));
typedef int64_t Longs __attribute__((vector_size(8 * kQuadricWidth)));
// Storage type.
typedef float FourFloats __attribute__((vector_size(4 * kQuadricWidth)));

inline Doubles splat4(double a) { return Doubles{} + a; }
inline Doubles widen(FourFloats a) { return __builtin_convertvector(a, Doubles); }

inline Doubles select(Longs mask, Doubles a, Doubles b) { return mask ? a : b; }

// If an element of a or b is NaN, the result is b's.
inline Doubles min(Doubles a, Doubles b) { return a < b ? a : b; }
inline Doubles max(Doubles a, Doubles b) { return a > b ? a : b; }
inline Doubles abs(Doubles a) { return (Doubles)((Longs)a & INT64_MAX); }
inline Doubles clamp(Doubles a, Doubles lower, Doubles upper) { return min(max(a, lower), upper); }

inline bool any(Longs mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }

}  // namespace limn
