#pragma once
// Three-vectors and colours over any scalar (double, or Dual).
#include <cmath>

namespace limn {

template <class S>
struct Vec3 {
  S x{}, y{}, z{};

  S& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  const S& operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

using Vec3d = Vec3<double>;
using Vec3f = Vec3<float>;

// These operators are always inlined. Compilers otherwise call functions that pass numbers with
// derivatives through memory.

// Scalar types of a sum and a product of scalars A and B (double with Dual gives Dual).
template <class A, class B>
using Sum = decltype(A{} + B{});
template <class A, class B>
using Product = decltype(A{} * B{});

template <class A, class B>
[[gnu::always_inline]] inline auto operator+(const Vec3<A>& a, const Vec3<B>& b) {
  return Vec3<Sum<A, B>>{a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator-(const Vec3<A>& a, const Vec3<B>& b) {
  return Vec3<Sum<A, B>>{a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class S>
[[gnu::always_inline]] inline Vec3<S> operator-(const Vec3<S>& a) {
  return {-a.x, -a.y, -a.z};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator*(const Vec3<A>& a, const B& s) {
  return Vec3<Product<A, B>>{a.x * s, a.y * s, a.z * s};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator*(const B& s, const Vec3<A>& a) {
  return a * s;
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator/(const Vec3<A>& a, const B& s) {
  return Vec3<Product<A, B>>{a.x / s, a.y / s, a.z / s};
}
template <class S>
[[gnu::always_inline]] inline Vec3<S>& operator+=(Vec3<S>& a, const Vec3<S>& b) {
  a.x += b.x;
  a.y += b.y;
  a.z += b.z;
  return a;
}
template <class S>
bool operator==(const Vec3<S>& a, const Vec3<S>& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

template <class A, class B>
[[gnu::always_inline]] inline auto dot(const Vec3<A>& a, const Vec3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class A, class B>
[[gnu::always_inline]] inline auto cross(const Vec3<A>& a, const Vec3<B>& b) {
  return Vec3<Product<A, B>>{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class S>
[[gnu::always_inline]] inline S length_squared(const Vec3<S>& a) {
  return dot(a, a);
}
template <class S>
S length(const Vec3<S>& a) {
  using std::sqrt;
  return sqrt(dot(a, a));
}
// Requires a nonzero vector.
template <class S>
Vec3<S> normalize(const Vec3<S>& a) {
  return a / length(a);
}
// det(a, b, c) = a . (b x c)
template <class A, class B, class C>
auto determinant(const Vec3<A>& a, const Vec3<B>& b, const Vec3<C>& c) {
  return dot(a, cross(b, c));
}

template <class T, class S>
Vec3<T> cast(const Vec3<S>& a) {
  return {static_cast<T>(a.x), static_cast<T>(a.y), static_cast<T>(a.z)};
}

// Two unit vectors that complete the unit vector n to a right-handed frame (Duff et al. 2017).
// Discontinuous in n: use only where the result is not differentiated.
template <class S>
struct FrameOf {
  Vec3<S> s, t, n;
  explicit FrameOf(const Vec3<S>& normal) : n(normal) {
    using std::copysign;
    const S sign = copysign(S(1.0), n.z);
    const S a = -1.0 / (sign + n.z);
    const S b = n.x * n.y * a;
    s = {1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    t = {b, sign + n.y * n.y * a, -n.y};
  }
  Vec3<S> to_world(const Vec3<S>& v) const { return s * v.x + t * v.y + n * v.z; }
  Vec3<S> to_local(const Vec3<S>& v) const { return {dot(s, v), dot(t, v), dot(n, v)}; }
};
using Frame = FrameOf<double>;

// Linear Rec.709 colour: radiance [W / (m^2 sr)], reflectance or throughput, per channel.
template <class S>
struct Rgb {
  S r{}, g{}, b{};

  S& operator[](int i) { return i == 0 ? r : i == 1 ? g : b; }
  const S& operator[](int i) const { return i == 0 ? r : i == 1 ? g : b; }
};

template <class S>
Rgb<S> grey(const S& v) {
  return {v, v, v};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator+(const Rgb<A>& a, const Rgb<B>& b) {
  return Rgb<Sum<A, B>>{a.r + b.r, a.g + b.g, a.b + b.b};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator-(const Rgb<A>& a, const Rgb<B>& b) {
  return Rgb<Sum<A, B>>{a.r - b.r, a.g - b.g, a.b - b.b};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator*(const Rgb<A>& a, const Rgb<B>& b) {
  return Rgb<Product<A, B>>{a.r * b.r, a.g * b.g, a.b * b.b};
}
template <class A, class B>
[[gnu::always_inline]] inline auto operator*(const Rgb<A>& a, const B& s) {
  return Rgb<Product<A, B>>{a.r * s, a.g * s, a.b * s};
}
template <class S>
[[gnu::always_inline]] inline Rgb<S>& operator+=(Rgb<S>& a, const Rgb<S>& b) {
  a.r += b.r;
  a.g += b.g;
  a.b += b.b;
  return a;
}
inline double max_channel(const Rgb<double>& c) { return std::fmax(c.r, std::fmax(c.g, c.b)); }
inline bool is_black(const Rgb<double>& c) { return c.r == 0 && c.g == 0 && c.b == 0; }
// Rec.709 luminance, with Mitsuba's weights.
template <class S>
S luminance(const Rgb<S>& c) {
  return c.r * 0.212671 + c.g * 0.715160 + c.b * 0.072169;
}

inline constexpr double kPi = 3.14159265358979323846;

}  // namespace limn
