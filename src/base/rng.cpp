// Low-discrepancy numbers: Owen-scrambled Sobol' points with shuffled indices (Burley 2020,
// "Practical hash-based Owen scrambling"; pbrt's padded Sobol' sampler).
//
// Every stream has its own points in four dimensions, Joe and Kuo's first. Among the points 2^m
// k to 2^m (k + 1) - 1 every elementary interval of volume 2^-m in dimensions 0 and 1 holds
// exactly one, for any scrambling. Sample n uses the point whose index is n, scrambled like a
// coordinate, so that streams of different purposes are uncorrelated. Owen scrambling (1995)
// flips a bit depending on all bits above it. The flips come from a hash in which every bit
// depends on itself and those above only (Laine and Karras 2011, with the constants of Vegdahl
// 2021). The hash adds an independent uniform number first, so each coordinate is exactly
// uniform.
#include "limn/core/rng.h"

#include <algorithm>
#include <array>
#include <bit>

#include "src/base/wide.h"

#if defined(__GFNI__) && defined(__AVX512VBMI__) && defined(__AVX512VL__)
#define LIMN_BIT_MATRICES  // eight words times a matrix of bits are few instructions
#include <immintrin.h>
#endif

namespace limn {
namespace {

using wide::HalfWords, wide::Words;

constexpr int kDimensions = 4;

// v[i]: the direction number of index bit i. The primitive polynomial has the given degree and
// inner coefficients (a row of new-joe-kuo-6, whose first numbers are m).
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

// The following functions work on one number (uint32_t) and on eight (SIMD).
template <class T>
[[gnu::always_inline]] constexpr T reversed(T x) {
  x = x << 24 | (x & 0xff00) << 8 | (x >> 8 & 0xff00) | x >> 24;
  x = (x & 0x0f0f0f0f) << 4 | (x >> 4 & 0x0f0f0f0f);
  x = (x & 0x33333333) << 2 | (x >> 2 & 0x33333333);
  return (x & 0x55555555) << 1 | (x >> 1 & 0x55555555);
}

// Points of the indices below 256, of those times 256, ..., in the dimensions from 2 on, as
// `reversed` computes them.
using Bytes = std::array<std::array<std::array<uint32_t, 256>, 4>, kDimensions - 2>;

constexpr Bytes make_bytes() {
  Bytes bytes{};
  for (int d = 2; d < kDimensions; ++d) {
    const std::array<uint32_t, 32> v = directions(d);
    for (int k = 0; k < 4; ++k) {
      for (uint32_t n = 1; n < 256; ++n) {
        // The point without the lowest bit of n, and the direction number of that bit.
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
#ifdef LIMN_BIT_MATRICES
// The same as products of bytes with 8 by 8 bit matrices: word j holds the contribution of byte (j
// + turn) % 4 of an index to byte j of its point. Its rows, last first, are the bits of a byte.
using Matrix = std::array<uint64_t, 4>;
constexpr Matrix make_matrix(int dimension, int turn) {
  Matrix matrix{};
  for (int j = 0; j < 4; ++j) {
    for (int bit = 0; bit < 8; ++bit) {
      const uint32_t column = kBytes[dimension - 2][(j + turn) % 4][size_t{1} << bit];
      for (int row = 0; row < 8; ++row) {
        matrix[j] |= uint64_t{column >> (8 * j + row) & 1} << (8 * (7 - row) + bit);
      }
    }
  }
  return matrix;
}
constexpr std::array<std::array<Matrix, 4>, kDimensions - 2> make_matrices() {
  std::array<std::array<Matrix, 4>, kDimensions - 2> matrices{};
  for (int d = 2; d < kDimensions; ++d) {
    for (int turn = 0; turn < 4; ++turn) matrices[d - 2][turn] = make_matrix(d, turn);
  }
  return matrices;
}
alignas(32) constexpr auto kMatrices = make_matrices();
// The permutation between byte i of word k of eight numbers and byte 8 k + i, or its inverse.
constexpr std::array<uint8_t, 32> make_order(bool back) {
  std::array<uint8_t, 32> order{};
  for (uint8_t i = 0; i < 8; ++i) {
    for (uint8_t k = 0; k < 4; ++k) {
      const uint8_t apart = 8 * k + i, together = 4 * i + k;
      (back ? order[together] : order[apart]) = back ? apart : together;
    }
  }
  return order;
}
alignas(32) constexpr std::array<uint8_t, 32> kApart = make_order(false);
alignas(32) constexpr std::array<uint8_t, 32> kTogether = make_order(true);
// All bytes are kept: GCC 12 warns of the uninitialised ones of the function without a mask.
[[gnu::always_inline]] inline __m256i in_order(const __m256i& order, const __m256i& bytes) {
  return _mm256_maskz_permutexvar_epi8(~0u, order, bytes);
}

[[gnu::always_inline]] inline HalfWords point_of_bytes(const HalfWords& n, int dimension) {
  const auto load = [](const auto& from) {
    return _mm256_load_si256(reinterpret_cast<const __m256i*>(from.data()));
  };
  const auto& matrices = kMatrices[dimension - 2];
  const __m256i bytes = in_order(load(kApart), (__m256i)n);
  const __m256i one = _mm256_permute4x64_epi64(bytes, 0x39);
  const __m256i two = _mm256_permute4x64_epi64(bytes, 0x4e);
  const __m256i three = _mm256_permute4x64_epi64(bytes, 0x93);
  const __m256i sum = _mm256_gf2p8affine_epi64_epi8(bytes, load(matrices[0]), 0) ^
                      _mm256_gf2p8affine_epi64_epi8(one, load(matrices[1]), 0) ^
                      _mm256_gf2p8affine_epi64_epi8(two, load(matrices[2]), 0) ^
                      _mm256_gf2p8affine_epi64_epi8(three, load(matrices[3]), 0);
  return (HalfWords)in_order(load(kTogether), sum);
}
// Bytes are swapped first; the product with 0x8040201008040201 reverses the bits of each.
[[gnu::always_inline]] inline HalfWords reversed(const HalfWords& x) {
  const __m256i swapped = _mm256_shuffle_epi8(
      (__m256i)x,
      _mm256_broadcastsi128_si256(_mm_set_epi32(0x0c0d0e0f, 0x08090a0b, 0x04050607, 0x00010203)));
  return (HalfWords)_mm256_gf2p8affine_epi64_epi8(
      swapped, _mm256_set1_epi64x(static_cast<int64_t>(0x8040201008040201)), 0);
}
#else
[[gnu::always_inline]] inline HalfWords point_of_bytes(const HalfWords& n, int dimension) {
  const auto of = [&](int i) { return point_of_bytes(n[i], dimension); };
  return HalfWords{of(0), of(1), of(2), of(3), of(4), of(5), of(6), of(7)};
}
#endif

// Points with reversed bits. The first dimension reverses an index; the second multiplies it by
// Pascal's triangle, that is, substitutes 1 + x in the polynomial of its bits.
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

// x: with reversed bits.
template <class T, class Key>
[[gnu::always_inline]] inline T scrambled(T x, const Key& key) {
  x ^= x * 0x3d20adea;
  x += low_half(key);
  x *= low_half(key >> 32) | 1;
  x ^= x * 0x05526c56;
  x ^= x * 0x53a22864;
  return reversed(x);
}

// Maps to [0, 1) through signed integers, which every processor converts.
[[gnu::always_inline]] inline wide::RawDoubles in_unit(const HalfWords& x) {
  const auto shifted = (wide::Ints)(x ^ 0x80000000);
  return (__builtin_convertvector(shifted, wide::RawDoubles) + 0x1p31) * 0x1p-32;
}

// The bits beyond 32, equal for all points of a stream. Without them an edge of a large mesh with a
// probability below 2^-32 could never be drawn.
[[gnu::always_inline]] inline double rest(uint64_t word) {
  return static_cast<double>(word >> 43) * 0x1.0p-53;
}
[[gnu::always_inline]] inline wide::RawDoubles rest(const Words& word) {
  return __builtin_convertvector((wide::Mask)(word >> 43), wide::RawDoubles) * 0x1.0p-53;
}

}  // namespace

double Rng::even_uniform() {
  const int dimension = dimension_;
  dimension_ = (dimension + 1) % kDimensions;
  if (dimension == 0) place_ = scrambled(reversed(sample_), next());
  const uint64_t word = next();
  return scrambled(reversed_point(place_, dimension), word) * 0x1.0p-32 + rest(word);
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
    wide::RawDoubles u[kDimensions];
    for (size_t k = 0; k < count; ++k) {
      const Words word = next();
      if (even) {
        const HalfWords point = reversed_point(place, static_cast<int>(k));
        u[k] = in_unit(scrambled(point, word)) + rest(word);
      } else {
        u[k] = __builtin_convertvector((wide::Mask)(word >> 11), wide::RawDoubles) * 0x1.0p-53;
      }
    }
    for (size_t i = first; i < last; ++i) {
      for (size_t k = 0; k < count; ++k) numbers[i * count + k] = u[k][i - first];
    }
  });
}

}  // namespace limn
