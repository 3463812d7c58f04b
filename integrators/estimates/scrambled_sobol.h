#pragma once
// Sobol's sequence in five dimensions, scrambled after Owen by hashes (Laine and Karras 2011): the
// first 2^k points of any stream are stratified in every dimension, and each point is uniform.
#include <array>
#include <cstdint>

#include "limn/core/rng.h"

namespace limn {

class ScrambledSobol {
 public:
  static constexpr int kDimensions = 5;

  // Streams of different keys are independent.
  explicit ScrambledSobol(uint64_t key) : key_(key) {}

  // Coordinate `dimension` of point `index`, in [0, 1). The order of the points is scrambled, too,
  // the same for all dimensions.
  double at(uint64_t index, int dimension) const {
    const uint32_t place = scramble(static_cast<uint32_t>(index), hash(~uint64_t{0}));
    uint32_t bits = 0;
    const auto& columns = kColumns[dimension];
    for (uint32_t rest = place, k = 0; rest != 0; rest >>= 1, ++k) {
      if (rest & 1) bits ^= columns[k];
    }
    return scramble(bits, hash(static_cast<uint64_t>(dimension))) * 0x1p-32;
  }

 private:
  using Columns = std::array<std::array<uint32_t, 32>, kDimensions>;
  // Direction numbers of Joe and Kuo (2008): degree, coefficients and first numbers of each
  // primitive polynomial.
  static constexpr Columns make_columns() {
    constexpr uint32_t kDegree[] = {0, 1, 2, 3, 3}, kPolynomial[] = {0, 0, 1, 1, 2};
    constexpr uint32_t kFirst[][3] = {{}, {1}, {1, 3}, {1, 3, 1}, {1, 1, 1}};
    Columns columns{};
    for (int k = 0; k < 32; ++k) columns[0][k] = uint32_t{1} << (31 - k);
    for (int d = 1; d < kDimensions; ++d) {
      const uint32_t s = kDegree[d];
      auto& v = columns[d];
      for (uint32_t k = 0; k < 32; ++k) {
        if (k < s) {
          v[k] = kFirst[d][k] << (31 - k);
          continue;
        }
        v[k] = v[k - s] ^ (v[k - s] >> s);
        for (uint32_t i = 1; i < s; ++i) {
          if (kPolynomial[d] >> (s - 1 - i) & 1) v[k] ^= v[k - i];
        }
      }
    }
    return columns;
  }
  static const Columns kColumns;

  uint32_t hash(uint64_t what) const {
    return static_cast<uint32_t>(mix_bits(key_ + 0x9e3779b97f4a7c15ull * (what + 2)) >> 32);
  }
  static uint32_t reversed(uint32_t x) {
    x = (x >> 16) | (x << 16);
    x = (x & 0x00ff00ffu) << 8 | (x & 0xff00ff00u) >> 8;
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
  }
  // Every bit is flipped by a hash of the bits above it.
  static uint32_t scramble(uint32_t x, uint32_t seed) {
    return reversed(laine_karras(reversed(x), seed));
  }
  // Lower bits change higher ones only. Constants of Burley 2020, "Practical Hash-based Owen
  // Scrambling".
  static uint32_t laine_karras(uint32_t x, uint32_t seed) {
    x += seed;
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return x;
  }

  uint64_t key_;
};

inline constexpr ScrambledSobol::Columns ScrambledSobol::kColumns = ScrambledSobol::make_columns();

}  // namespace limn
