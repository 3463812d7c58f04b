#pragma once
// Half floats decoded without branches on any processor: IEEE 754 binary16, except that the largest
// exponent means one more power of two instead of infinity.
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>

namespace limn {

class Half {
 public:
  Half() = default;
  // Rounds towards zero; exact for values that came from finite halves. Values out of range are not
  // preserved: callers compare.
  explicit Half(float v) {
    const auto bits = std::bit_cast<uint32_t>(std::fabs(v) * 0x1p-112f);
    bits_ = static_cast<uint16_t>(((bits >> 13) & 0x7fff) | (std::signbit(v) ? 0x8000 : 0));
  }
  // Shifts the exponent from 5 to 8 bits; the factor corrects the bias.
  operator float() const {  // NOLINT: a half is a float, implicitly
    const float size = std::bit_cast<float>(static_cast<uint32_t>(bits_ & 0x7fff) << 13) * 0x1p112f;
    return std::bit_cast<float>(std::bit_cast<uint32_t>(size) |
                                static_cast<uint32_t>(bits_ & 0x8000) << 16);
  }

 private:
  uint16_t bits_ = 0;
};

// Four numbers in a SIMD vector.
using FourDoubles [[gnu::vector_size(32)]] = double;
inline FourDoubles to_doubles(const std::array<Half, 4>& halves) {
  using Shorts [[gnu::vector_size(8)]] = uint16_t;
  using Words [[gnu::vector_size(16)]] = uint32_t;
  using Floats [[gnu::vector_size(16)]] = float;
  const Words bits = __builtin_convertvector(std::bit_cast<Shorts>(halves), Words);
  const Floats size = (Floats)((bits & 0x7fff) << 13) * 0x1p112f;
  return __builtin_convertvector((Floats)((Words)size | (bits & 0x8000) << 16), FourDoubles);
}
inline FourDoubles to_doubles(const std::array<float, 4>& floats) {
  using Floats [[gnu::vector_size(16)]] = float;
  return __builtin_convertvector(std::bit_cast<Floats>(floats), FourDoubles);
}

}  // namespace limn
