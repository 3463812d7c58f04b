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

#include <array>
#include <bit>

namespace limn {
namespace {

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

constexpr uint32_t reversed(uint32_t x) {
  x = __builtin_bswap32(x);
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

// With its bits in reverse: the first dimension reverses a number, and the second multiplies it by
// Pascal's triangle, which is to put 1 + x for x in the polynomial of its bits.
uint32_t reversed_point(uint32_t n, int dimension) {
  if (dimension == 0) return n;
  if (dimension == 1) {
    n ^= n >> 16;
    n ^= n >> 8 & 0x00ff00ff;
    n ^= n >> 4 & 0x0f0f0f0f;
    n ^= n >> 2 & 0x33333333;
    return n ^ (n >> 1 & 0x55555555);
  }
  const auto& bytes = kBytes[dimension - 2];
  return bytes[0][n & 255] ^ bytes[1][n >> 8 & 255] ^ bytes[2][n >> 16 & 255] ^ bytes[3][n >> 24];
}

// x: with its bits in reverse.
uint32_t scrambled(uint32_t x, uint64_t key) {
  x ^= x * 0x3d20adea;
  x += static_cast<uint32_t>(key);
  x *= static_cast<uint32_t>(key >> 32) | 1;
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

}  // namespace limn
