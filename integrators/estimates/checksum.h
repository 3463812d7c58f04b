#pragma once
#include <array>
#include <cstdint>
#include <string_view>

namespace limn {

// CRC-32 of bytes, as in PNG and zlib (ISO 3309): it detects every flipped bit.
inline uint32_t checksum(std::string_view bytes) {
  static constexpr auto kTable = [] {
    std::array<uint32_t, 256> table{};
    for (uint32_t i = 0; i < table.size(); ++i) {
      table[i] = i;
      for (int bit = 0; bit < 8; ++bit) table[i] = table[i] >> 1 ^ (table[i] & 1) * 0xedb88320u;
    }
    return table;
  }();
  uint32_t sum = ~0u;
  for (const char c : bytes) sum = kTable[(sum ^ static_cast<unsigned char>(c)) & 255] ^ sum >> 8;
  return ~sum;
}

}  // namespace limn
