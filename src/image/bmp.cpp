// Windows bitmaps without compression: 8 bits with a palette, 24 or 32 bits.
#include "limn/core/error.h"
#include "src/image/formats.h"

namespace limn {
namespace {

// Little-endian numbers of a file; the caller has checked its size.
class Bytes {
 public:
  explicit Bytes(std::string_view data) : data_(data) {}
  uint32_t byte(size_t at) const { return static_cast<uint8_t>(data_[at]); }
  uint32_t two(size_t at) const { return byte(at) | byte(at + 1) << 8; }
  uint32_t four(size_t at) const { return two(at) | two(at + 2) << 16; }

 private:
  std::string_view data_;
};

constexpr size_t kHeaders = 54;  // of the file, and the shortest of a bitmap that is read

}  // namespace

StoredImage read_bmp(const std::string& file, std::string_view data) {
  const auto fail = [&](const std::string& message) { throw InputError({file}, message); };
  if (data.size() < kHeaders) fail("the BMP file is truncated");
  const Bytes bytes(data);
  const uint64_t pixels = bytes.four(10), header = bytes.four(14);
  const auto width = static_cast<int32_t>(bytes.four(18));
  const auto height = static_cast<int32_t>(bytes.four(22));  // negative: row 0 comes first
  const uint32_t bits = bytes.two(28);
  if (header < 40) fail("the BMP file has an old header, of " + std::to_string(header) + " bytes");
  if (bytes.four(30) != 0) fail("the BMP file is compressed, which is not read: use PNG");
  if (bits != 8 && bits != 24 && bits != 32) {
    fail("the BMP file has " + std::to_string(bits) + " bits per pixel (known: 8, 24, 32)");
  }
  if (width <= 0) fail("the BMP file has a width of " + std::to_string(width));
  const auto rows = static_cast<uint64_t>(std::abs(int64_t{height}));
  check_image_size(file, data, static_cast<uint64_t>(width), rows, 1, 3);
  const uint64_t row = (uint64_t{bits} * static_cast<uint64_t>(width) + 31) / 32 * 4;
  if (pixels > data.size() || row * rows > data.size() - pixels) fail("the BMP file is truncated");
  const uint64_t palette = 14 + header;
  const uint64_t colours = bytes.four(46) == 0 ? 256 : bytes.four(46);
  if (bits == 8 && (colours > 256 || palette + 4 * colours > data.size())) {
    fail("the palette of the BMP file is damaged");
  }
  StoredImage image{width, static_cast<int>(rows), 3, true, {}, {}};
  image.bytes.reserve(3 * static_cast<uint64_t>(width) * rows);
  for (uint64_t y = 0; y < rows; ++y) {
    const uint64_t line = pixels + row * (height < 0 ? y : rows - 1 - y);
    for (uint64_t x = 0; x < static_cast<uint64_t>(width); ++x) {
      uint64_t at = line + x * (bits / 8);
      if (bits == 8) {
        const uint64_t colour = bytes.byte(at);
        if (colour >= colours) fail("the BMP file names a colour beyond its palette");
        at = palette + 4 * colour;
      }
      for (int c = 2; c >= 0; --c) image.bytes.push_back(static_cast<uint8_t>(bytes.byte(at + c)));
    }
  }
  return image;
}

}  // namespace limn
