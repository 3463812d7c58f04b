#pragma once
// Forward-mode automatic differentiation: a value and up to kLanes partial derivatives.
#include <algorithm>
#include <cmath>
#include <type_traits>

#include "limn/core/vec.h"

namespace limn {

// Parameters differentiated in one pass. Four doubles fill one AVX register.
inline constexpr int kLanes = 4;

// Derivatives of one value with respect to the parameters of a pass.
struct Lanes {
  double lane[kLanes] = {0, 0, 0, 0};

  Lanes() = default;
  Lanes(double a, double b, double c, double d) : lane{a, b, c, d} {}
  double& operator[](int i) { return lane[i]; }
  double operator[](int i) const { return lane[i]; }
};

// Always inlined, as the operators of vec.h are.
[[gnu::always_inline]] inline Lanes operator+(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r[i] = a[i] + b[i];
  return r;
}
[[gnu::always_inline]] inline Lanes operator-(const Lanes& a, const Lanes& b) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r[i] = a[i] - b[i];
  return r;
}
[[gnu::always_inline]] inline Lanes operator-(const Lanes& a) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r[i] = -a[i];
  return r;
}
[[gnu::always_inline]] inline Lanes operator*(const Lanes& a, double s) {
  Lanes r;
  for (int i = 0; i < kLanes; ++i) r[i] = a[i] * s;
  return r;
}
[[gnu::always_inline]] inline Lanes operator*(double s, const Lanes& a) { return a * s; }
[[gnu::always_inline]] inline Lanes operator/(const Lanes& a, double s) { return a * (1 / s); }
[[gnu::always_inline]] inline Lanes& operator+=(Lanes& a, const Lanes& b) { return a = a + b; }
inline bool is_zero(const Lanes& a) { return a[0] == 0 && a[1] == 0 && a[2] == 0 && a[3] == 0; }

struct Dual {
  double v = 0;
  Lanes d;

  Dual() = default;
  Dual(double value) : v(value) {}  // NOLINT: a constant is a dual number, implicitly
  Dual(double value, const Lanes& derivative) : v(value), d(derivative) {}
};

[[gnu::always_inline]] inline Dual operator+(const Dual& a, const Dual& b) {
  return {a.v + b.v, a.d + b.d};
}
[[gnu::always_inline]] inline Dual operator-(const Dual& a, const Dual& b) {
  return {a.v - b.v, a.d - b.d};
}
[[gnu::always_inline]] inline Dual operator*(const Dual& a, const Dual& b) {
  return {a.v * b.v, a.d * b.v + b.d * a.v};
}
[[gnu::always_inline]] inline Dual operator/(const Dual& a, const Dual& b) {
  const double q = a.v / b.v;
  return {q, (a.d - b.d * q) / b.v};
}
[[gnu::always_inline]] inline Dual operator+(const Dual& a, double b) { return {a.v + b, a.d}; }
[[gnu::always_inline]] inline Dual operator+(double a, const Dual& b) { return {a + b.v, b.d}; }
[[gnu::always_inline]] inline Dual operator-(const Dual& a, double b) { return {a.v - b, a.d}; }
[[gnu::always_inline]] inline Dual operator-(double a, const Dual& b) { return {a - b.v, -b.d}; }
[[gnu::always_inline]] inline Dual operator*(const Dual& a, double b) { return {a.v * b, a.d * b}; }
[[gnu::always_inline]] inline Dual operator*(double a, const Dual& b) { return {a * b.v, b.d * a}; }
[[gnu::always_inline]] inline Dual operator/(const Dual& a, double b) { return {a.v / b, a.d / b}; }
[[gnu::always_inline]] inline Dual operator/(double a, const Dual& b) {
  const double q = a / b.v;
  return {q, -b.d * (q / b.v)};
}
[[gnu::always_inline]] inline Dual operator-(const Dual& a) { return {-a.v, -a.d}; }
[[gnu::always_inline]] inline Dual& operator+=(Dual& a, const Dual& b) {
  a.v += b.v;
  a.d += b.d;
  return a;
}
[[gnu::always_inline]] inline Dual& operator*=(Dual& a, const Dual& b) { return a = a * b; }

// Comparisons use the value alone.
inline bool operator<(const Dual& a, const Dual& b) { return a.v < b.v; }
inline bool operator>(const Dual& a, const Dual& b) { return a.v > b.v; }
inline bool operator<=(const Dual& a, const Dual& b) { return a.v <= b.v; }
inline bool operator>=(const Dual& a, const Dual& b) { return a.v >= b.v; }
inline bool operator==(const Dual& a, const Dual& b) { return a.v == b.v; }

// The derivative of sqrt at 0 is defined as 0.
[[gnu::always_inline]] inline Dual sqrt(const Dual& a) {
  const double r = std::sqrt(a.v);
  return {r, r > 0 ? a.d * (0.5 / r) : Lanes{}};
}
inline Dual exp(const Dual& a) {
  const double e = std::exp(a.v);
  return {e, a.d * e};
}
inline Dual sin(const Dual& a) { return {std::sin(a.v), a.d * std::cos(a.v)}; }
inline Dual cos(const Dual& a) { return {std::cos(a.v), a.d * -std::sin(a.v)}; }
inline Dual tan(const Dual& a) {
  const double t = std::tan(a.v);
  return {t, a.d * (1 + t * t)};
}
inline Dual acos(const Dual& a) {
  const double s = std::sqrt(std::max(0.0, 1 - a.v * a.v));
  return {std::acos(a.v), s > 0 ? a.d * (-1 / s) : Lanes{}};
}
inline Dual atan2(const Dual& y, const Dual& x) {
  const double r2 = x.v * x.v + y.v * y.v;
  return {std::atan2(y.v, x.v), r2 > 0 ? (y.d * x.v - x.d * y.v) / r2 : Lanes{}};
}
inline Dual max(const Dual& a, const Dual& b) { return a.v >= b.v ? a : b; }
inline Dual min(const Dual& a, const Dual& b) { return a.v <= b.v ? a : b; }

// True if all derivatives are zero.
inline bool is_constant(const Dual& a) { return is_zero(a.d); }
inline bool is_constant(const Vec3<Dual>& a) {
  return is_constant(a.x) && is_constant(a.y) && is_constant(a.z);
}
inline bool is_constant(const Rgb<Dual>& a) {
  return is_constant(a.r) && is_constant(a.g) && is_constant(a.b);
}

inline double value(double a) { return a; }
inline double value(const Dual& a) { return a.v; }
template <class S>
Vec3d value(const Vec3<S>& a) {
  return {value(a.x), value(a.y), value(a.z)};
}
template <class S>
Rgb<double> value(const Rgb<S>& a) {
  return {value(a.r), value(a.g), value(a.b)};
}

// Converts a stored dual number to the scalar type S of a computation.
template <class S>
S as(const Dual& a) {
  if constexpr (std::is_same_v<S, double>) {
    return a.v;
  } else {
    return a;
  }
}
template <class S>
Vec3<S> as(const Vec3<Dual>& a) {
  return {as<S>(a.x), as<S>(a.y), as<S>(a.z)};
}
template <class S>
Rgb<S> as(const Rgb<Dual>& a) {
  return {as<S>(a.r), as<S>(a.g), as<S>(a.b)};
}

}  // namespace limn
