#pragma once
// The scalar of reverse-mode differentiation: records its computation on this thread's tape.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "limn/core/dual.h"
#include "limn/core/tape.h"
#include "limn/core/vec.h"

namespace limn {

// A value and its tape node.
struct Var {
  double v = 0;
  uint32_t node = 0;

  Var() = default;
  Var(double value) : v(value) {}  // NOLINT: a constant is a Var, implicitly
  Var(double value, uint32_t index) : v(value), node(index) {}
};

namespace detail {
// Records a function of one or two Vars with its partial derivatives.
inline Var unary(double v, const Var& a, double da) {
  if (a.node == 0) return v;
  Tape& tape = *Tape::current();
  tape.entry(a.node, da);
  return {v, tape.end()};
}
inline Var binary(double v, const Var& a, double da, const Var& b, double db) {
  if ((a.node | b.node) == 0) return v;
  Tape& tape = *Tape::current();
  tape.entry(a.node, da);
  tape.entry(b.node, db);
  return {v, tape.end()};
}
}  // namespace detail

inline Var operator+(const Var& a, const Var& b) { return detail::binary(a.v + b.v, a, 1, b, 1); }
inline Var operator-(const Var& a, const Var& b) { return detail::binary(a.v - b.v, a, 1, b, -1); }
inline Var operator*(const Var& a, const Var& b) {
  return detail::binary(a.v * b.v, a, b.v, b, a.v);
}
inline Var operator/(const Var& a, const Var& b) {
  const double q = a.v / b.v;
  return detail::binary(q, a, 1 / b.v, b, -q / b.v);
}
inline Var operator+(const Var& a, double b) { return {a.v + b, a.node}; }
inline Var operator+(double a, const Var& b) { return {a + b.v, b.node}; }
inline Var operator-(const Var& a, double b) { return {a.v - b, a.node}; }
inline Var operator-(double a, const Var& b) { return detail::unary(a - b.v, b, -1); }
inline Var operator*(const Var& a, double b) { return detail::unary(a.v * b, a, b); }
inline Var operator*(double a, const Var& b) { return detail::unary(a * b.v, b, a); }
inline Var operator/(const Var& a, double b) { return detail::unary(a.v / b, a, 1 / b); }
inline Var operator/(double a, const Var& b) {
  const double q = a / b.v;
  return detail::unary(q, b, -q / b.v);
}
inline Var operator-(const Var& a) { return detail::unary(-a.v, a, -1); }
inline Var& operator+=(Var& a, const Var& b) { return a = a + b; }
inline Var& operator*=(Var& a, const Var& b) { return a = a * b; }

// Comparisons use the value alone.
inline bool operator<(const Var& a, const Var& b) { return a.v < b.v; }
inline bool operator>(const Var& a, const Var& b) { return a.v > b.v; }
inline bool operator<=(const Var& a, const Var& b) { return a.v <= b.v; }
inline bool operator>=(const Var& a, const Var& b) { return a.v >= b.v; }
inline bool operator==(const Var& a, const Var& b) { return a.v == b.v; }

// Derivatives at the ends of the domain are those of Dual.
inline Var sqrt(const Var& a) {
  const double r = std::sqrt(a.v);
  return detail::unary(r, a, r > 0 ? 0.5 / r : 0);
}
inline Var exp(const Var& a) {
  const double e = std::exp(a.v);
  return detail::unary(e, a, e);
}
inline Var sin(const Var& a) { return detail::unary(std::sin(a.v), a, std::cos(a.v)); }
inline Var cos(const Var& a) { return detail::unary(std::cos(a.v), a, -std::sin(a.v)); }
inline Var tan(const Var& a) {
  const double t = std::tan(a.v);
  return detail::unary(t, a, 1 + t * t);
}
inline Var acos(const Var& a) {
  const double s = std::sqrt(std::max(0.0, 1 - a.v * a.v));
  return detail::unary(std::acos(a.v), a, s > 0 ? -1 / s : 0);
}
inline Var atan2(const Var& y, const Var& x) {
  const double r2 = x.v * x.v + y.v * y.v;
  const double inverse = r2 > 0 ? 1 / r2 : 0;
  return detail::binary(std::atan2(y.v, x.v), y, x.v * inverse, x, -y.v * inverse);
}
inline Var max(const Var& a, const Var& b) { return a.v >= b.v ? a : b; }
inline Var min(const Var& a, const Var& b) { return a.v <= b.v ? a : b; }

inline double value(const Var& a) { return a.v; }
inline bool is_constant(const Var& a) { return a.node == 0; }
inline bool is_constant(const Vec3<Var>& a) { return (a.x.node | a.y.node | a.z.node) == 0; }
inline bool is_constant(const Rgb<Var>& a) { return (a.r.node | a.g.node | a.b.node) == 0; }

// Dot product and normalisation as one statement each, instead of five and ten.
inline Var dot(const Vec3<Var>& a, const Vec3<Var>& b) {
  const double v = dot(value(a), value(b));
  if (is_constant(a) && is_constant(b)) return v;
  Tape& tape = *Tape::current();
  for (int k = 0; k < 3; ++k) tape.entry(a[k].node, b[k].v);
  for (int k = 0; k < 3; ++k) tape.entry(b[k].node, a[k].v);
  return {v, tape.end()};
}
inline Var dot(const Vec3<Var>& a, const Vec3d& b) {
  const double v = dot(value(a), b);
  if (is_constant(a)) return v;
  Tape& tape = *Tape::current();
  for (int k = 0; k < 3; ++k) tape.entry(a[k].node, b[k]);
  return {v, tape.end()};
}
inline Var dot(const Vec3d& a, const Vec3<Var>& b) { return dot(b, a); }
inline Vec3<Var> normalize(const Vec3<Var>& a) {
  const Vec3d v = value(a);
  const double size = length(v);
  const Vec3d u = v / size;
  if (is_constant(a)) return {u.x, u.y, u.z};
  Tape& tape = *Tape::current();
  Vec3<Var> unit;
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 3; ++j) tape.entry(a[j].node, ((k == j) - u[k] * u[j]) / size);
    unit[k] = {u[k], tape.end()};
  }
  return unit;
}

}  // namespace limn
