// Even numbers: Sobol' points, scrambled and in an order of chance (Burley 2020, "Practical
// hash-based Owen scrambling"; what pbrt calls a padded Sobol' sampler).
//
// Every stream has its own points of four dimensions, Joe and Kuo's first: of the points 2^m k to
// 2^m (k + 1) - 1 every box of volume 2^-m in dimensions 0 and 1 that is a product of halves of
// halves holds exactly one, whatever the scrambling. Sample n takes the point whose number is n,
// scrambled like a coordinate, so that streams of different purposes have nothing in common. A
// scrambling chooses for every prefix of a number's bits whether the next bit is turned around
// (Owen 1995); here a hash chooses, in which every bit depends on itself and those above it (Laine
// and Karras 2011, with the constants of Vegdahl 2021). It adds a number that is uniform and
// independent of all else, so that each coordinate by itself is exactly uniform.
#include "limn/core/rng.h"

#include <algorithm>
#include <array>
#include <bit>

#include "src/base/wide.h"

namespace limn {
namespace {

using wide::HalfWords, wide::Words;

constexpr int kDimensions = 4;

// v[i]: what bit i of a point's number turns around; the primitive polynomial has the degree and
// the inner coefficients of a row of new-joe-kuo-6, whose first numbers are m.
constexpr std::array<uint32_t, 32> directions(int dimension) {
  struct Row {
    int degree;
    uint32_t inner;
    uint32_t m[3];
  };
  constexpr Row kRows[kDimensions] = {{0, 0, {}}, {1, 0, {1}}, {2, 1, {1, 3}}, {3, 1, {1, 3, 1}}};
  const auto& [degree, inner, m] = kRows[dimension];
  std::array<uint32_t, 32> v{};
  for (int i = 0; i < 32; ++i) {
    if (i < degree || degree == 0) {
      v[i] = (degree == 0 ? 1 : m[i]) << (31 - i);
      continue;
    }
    v[i] = v[i - degree] ^ (v[i - degree] >> degree);
    for (int k = 1; k < degree; ++k) {
      if (inner >> (degree - 1 - k) & 1) v[i] ^= v[i - k];
    }
  }
  return v;
}

// What follows is written once for one number (uint32_t) and for eight side by side.
template <class T>
[[gnu::always_inline]] constexpr T reversed(T x) {
  x = x << 24 | (x & 0xff00) << 8 | (x >> 8 & 0xff00) | x >> 24;
  x = (x & 0x0f0f0f0f) << 4 | (x >> 4 & 0x0f0f0f0f);
  x = (x & 0x33333333) << 2 | (x >> 2 & 0x33333333);
  return (x & 0x55555555) << 1 | (x >> 1 & 0x55555555);
}

// The points of the numbers below 256, those times 256, ..., in the dimensions from 2 on, as
// `reversed` has them.
using Bytes = std::array<std::array<std::array<uint32_t, 256>, 4>, kDimensions - 2>;

constexpr Bytes make_bytes() {
  Bytes bytes{};
  for (int d = 2; d < kDimensions; ++d) {
    const std::array<uint32_t, 32> v = directions(d);
    for (int k = 0; k < 4; ++k) {
      for (uint32_t n = 1; n < 256; ++n) {
        // Without its lowest bit, and what that one turns around.
        const int low = std::countr_zero(n);
        bytes[d - 2][k][n] = bytes[d - 2][k][n & (n - 1)] ^ reversed(v[8 * k + low]);
      }
    }
  }
  return bytes;
}
constexpr Bytes kBytes = make_bytes();

uint32_t point_of_bytes(uint32_t n, int dimension) {
  const auto& bytes = kBytes[dimension - 2];
  return bytes[0][n & 255] ^ bytes[1][n >> 8 & 255] ^ bytes[2][n >> 16 & 255] ^ bytes[3][n >> 24];
}
[[gnu::always_inline]] inline HalfWords point_of_bytes(const HalfWords& n, int dimension) {
  const auto of = [&](int i) { return point_of_bytes(n[i], dimension); };
  return HalfWords{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
}

// With its bits in reverse: the first dimension reverses a number, and the second multiplies it by
// Pascal's triangle, which is to put 1 + x for x in the polynomial of its bits.
template <class T>
[[gnu::always_inline]] inline T reversed_point(T n, int dimension) {
  if (dimension == 0) return n;
  if (dimension > 1) return point_of_bytes(n, dimension);
  n ^= n >> 16;
  n ^= n >> 8 & 0x00ff00ff;
  n ^= n >> 4 & 0x0f0f0f0f;
  n ^= n >> 2 & 0x33333333;
  return n ^ (n >> 1 & 0x55555555);
}

uint32_t low_half(uint64_t word) { return static_cast<uint32_t>(word); }
[[gnu::always_inline]] inline HalfWords low_half(const Words& word) {
  return __builtin_convertvector(word, HalfWords);
}

// x: with its bits in reverse.
template <class T, class Key>
[[gnu::always_inline]] inline T scrambled(T x, const Key& key) {
  x ^= x * 0x3d20adea;
  x += low_half(key);
  x *= low_half(key >> 32) | 1;
  x ^= x * 0x05526c56;
  x ^= x * 0x53a22864;
  return reversed(x);
}

}  // namespace

double Rng::even_uniform() {
  const int dimension = dimension_;
  dimension_ = (dimension + 1) % kDimensions;
  if (dimension == 0) place_ = scrambled(reversed(sample_), next());
  return scrambled(reversed_point(place_, dimension), next()) * 0x1.0p-32;
}

void Rng::draw(Purpose purpose, std::span<const Stream> streams, size_t count, double* numbers) {
  static_assert(Rng::kDimensions == limn::kDimensions);
  const bool even = streams[0].key->dimension_ >= 0;
  wide::for_blocks(streams.size(), [&](size_t first, size_t last) {
    const auto stream = [&](int i) -> const Stream& {
      return streams[std::min(first + static_cast<size_t>(i), last - 1)];
    };
    const auto words = [](const auto& of) {
      return Words{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
    };
    const Words depth = words([&](int i) { return stream(i).depth; });
    const Words sample = words([&](int i) { return uint64_t{stream(i).key->sample_}; });
    Words state = words([&](int i) { return stream(i).key->key_; });
    state = detail::mix_words(state + kGolden * place_of(purpose, depth));
    const auto next = [&] {
      state += kGolden;
      return detail::mix_words(state);
    };
    HalfWords place{};
    if (even) place = scrambled(reversed(low_half(sample)), next());
    for (size_t k = 0; k < count; ++k) {
      const Words word = next();
      wide::RawDoubles u;
      if (even) {
        const HalfWords point = reversed_point(place, static_cast<int>(k));
        u = __builtin_convertvector(scrambled(point, word), wide::RawDoubles) * 0x1.0p-32;
      } else {
        u = __builtin_convertvector((wide::Mask)(word >> 11), wide::RawDoubles) * 0x1.0p-53;
      }
      for (size_t i = first; i < last; ++i) numbers[i * count + k] = u[i - first];
    }
  });
}

}  // namespace limn
