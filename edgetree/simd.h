#pragma once
// Eight floats or ints in a SIMD vector (extension of GCC and Clang), one per child of a
// node. Arithmetic and comparisons are element-wise; comparisons give integer masks, -1
// (true) or 0.
#include <cmath>
#include <cstdint>
#ifdef __AVX__
#include <immintrin.h>
#endif

namespace limn {

inline constexpr int kWidth = 8;

typedef float Floats __attribute__((vector_size(4 * kWidth)));
typedef int32_t Ints __attribute__((vector_size(4 * kWidth)));

inline Floats splat(float a) { return Floats{} + a; }

// Element-wise: a where the mask is true, else b.
inline Floats select(Ints mask, Floats a, Floats b) { return mask ? a : b; }

// If an element of a or b is NaN, the result is b's.
inline Floats min(Floats a, Floats b) { return a < b ? a : b; }
inline Floats max(Floats a, Floats b) { return a > b ? a : b; }
inline Floats abs(Floats a) { return (Floats)((Ints)a & 0x7fffffff); }
inline Floats clamp(Floats a, Floats lower, Floats upper) { return min(max(a, lower), upper); }

inline Floats sqrt(Floats a) {
  Floats r;
  for (int i = 0; i < kWidth; ++i) r[i] = std::sqrt(a[i]);
  return r;
}

inline Floats to_float(Ints a) { return __builtin_convertvector(a, Floats); }

inline float sum(Floats a) {
  static_assert(kWidth == 8);
  return ((a[0] + a[4]) + (a[2] + a[6])) + ((a[1] + a[5]) + (a[3] + a[7]));
}

// Bit i: element i of the mask is true.
inline uint32_t bits(Ints mask) {
#ifdef __AVX__
  return static_cast<uint32_t>(_mm256_movemask_ps((__m256)mask));
#else
  uint32_t result = 0;
  for (int i = 0; i < kWidth; ++i) result |= static_cast<uint32_t>(mask[i] & 1) << i;
  return result;
#endif
}

// A SIMD vector of three-vectors.
struct Floats3 {
  Floats x, y, z;
};
inline Floats3 operator*(const Floats3& a, Floats s) { return {a.x * s, a.y * s, a.z * s}; }
inline Floats dot(const Floats3& a, const Floats3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

}  // namespace limn
