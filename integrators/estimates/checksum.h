#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <string_view>

namespace limn {

// CRC-32 of bytes, as in PNG and zlib (ISO 3309): it detects every flipped bit.
inline uint32_t checksum(std::string_view bytes) {
  // kTables[k][i]: of the byte i with k bytes of 0 after it, so that eight bytes go at once.
  static constexpr auto kTables = [] {
    std::array<std::array<uint32_t, 256>, 8> tables{};
    for (uint32_t i = 0; i < 256; ++i) {
      uint32_t& sum = tables[0][i] = i;
      for (int bit = 0; bit < 8; ++bit) sum = sum >> 1 ^ (sum & 1) * 0xedb88320u;
    }
    for (size_t k = 1; k < tables.size(); ++k) {
      for (size_t i = 0; i < 256; ++i) {
        const uint32_t sum = tables[k - 1][i];
        tables[k][i] = tables[0][sum & 255] ^ sum >> 8;
      }
    }
    return tables;
  }();
  uint32_t sum = ~0u;
  for (; bytes.size() >= kTables.size(); bytes.remove_prefix(kTables.size())) {
    uint64_t eight;  // in memory the first is the lowest
    std::memcpy(&eight, bytes.data(), sizeof(eight));
    eight ^= sum;
    sum = 0;
    for (size_t k = 0; k < kTables.size(); ++k) sum ^= kTables[7 - k][eight >> 8 * k & 255];
  }
  for (const char c : bytes)
    sum = kTables[0][(sum ^ static_cast<unsigned char>(c)) & 255] ^ sum >> 8;
  return ~sum;
}

}  // namespace limn
