#pragma once
// Four lanes of float, int or double (vector extension of GCC and Clang): the four children of a
// node side by side. Arithmetic and comparisons work lane by lane; a comparison gives -1 (true) or
// 0 in integer lanes.
#include <cmath>
#include <cstdint>
#include <cstring>

namespace limn {

inline constexpr int kWidth = 4;

typedef float Float4 __attribute__((vector_size(16)));
typedef int32_t Int4 __attribute__((vector_size(16)));
typedef double Double4 __attribute__((vector_size(32)));
typedef int64_t Long4 __attribute__((vector_size(32)));

inline Float4 splat(float a) { return Float4{a, a, a, a}; }
inline Int4 splat(int32_t a) { return Int4{a, a, a, a}; }
inline Double4 splat(double a) { return Double4{a, a, a, a}; }

// Any alignment.
inline Float4 load4(const float* from) {
  Float4 r;
  std::memcpy(&r, from, sizeof r);
  return r;
}
inline void store4(Float4 a, float* to) { std::memcpy(to, &a, sizeof a); }

// a where the mask's lane is true, else b.
inline Float4 select(Int4 mask, Float4 a, Float4 b) { return mask ? a : b; }
inline Int4 select(Int4 mask, Int4 a, Int4 b) { return mask ? a : b; }
inline Double4 select(Long4 mask, Double4 a, Double4 b) { return mask ? a : b; }

// If a lane of a or b is not a number, the result is b's.
inline Float4 min(Float4 a, Float4 b) { return a < b ? a : b; }
inline Float4 max(Float4 a, Float4 b) { return a > b ? a : b; }
inline Double4 min(Double4 a, Double4 b) { return a < b ? a : b; }
inline Double4 max(Double4 a, Double4 b) { return a > b ? a : b; }
inline Float4 abs(Float4 a) { return (Float4)((Int4)a & 0x7fffffff); }
inline Float4 clamp(Float4 a, Float4 lower, Float4 upper) { return min(max(a, lower), upper); }

inline Float4 sqrt(Float4 a) {
  Float4 r;
  for (int i = 0; i < kWidth; ++i) r[i] = std::sqrt(a[i]);
  return r;
}

inline Double4 to_double(Float4 a) { return __builtin_convertvector(a, Double4); }
// Rounds to nearest.
inline Float4 to_float(Double4 a) { return __builtin_convertvector(a, Float4); }

inline bool any(Int4 mask) { return (mask[0] | mask[1] | mask[2] | mask[3]) != 0; }
inline float sum(Float4 a) { return (a[0] + a[1]) + (a[2] + a[3]); }

// A three-vector per lane.
struct Float4x3 {
  Float4 x, y, z;
};
inline Float4x3 operator+(const Float4x3& a, const Float4x3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Float4x3 operator-(const Float4x3& a, const Float4x3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Float4x3 operator*(const Float4x3& a, Float4 s) { return {a.x * s, a.y * s, a.z * s}; }
inline Float4 dot(const Float4x3& a, const Float4x3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

}  // namespace limn
