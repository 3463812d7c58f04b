// Radiance's RGBE images (.hdr): four bytes a pixel, three mantissas and their exponent, plain or
// with runs (G. Ward, Real Pixels, Graphics Gems II, 1991).
#include <array>
#include <cmath>

#include "limn/core/error.h"
#include "src/base/text.h"
#include "src/image/formats.h"

namespace limn {
namespace {

class RgbeReader {
 public:
  RgbeReader(const std::string& file, std::string_view data) : file_(file), data_(data) {}

  StoredImage read() {
    read_header();
    // Old runs have no bound but the width. Memory is taken while lines come.
    constexpr double kPixelsPerByte = 4096;  // not tuned
    check_image_size(file_, data_, width_, height_, kPixelsPerByte, 12);
    StoredImage image{static_cast<int>(width_), static_cast<int>(height_), 3, false, {}, {}};
    std::vector<Pixel> line(width_);
    for (uint64_t y = 0; y < height_; ++y) {
      read_line(line);
      for (const Pixel& p : line) {
        const float unit = p[3] == 0 ? 0 : std::ldexp(1.0f, p[3] - (128 + 8));
        for (size_t c = 0; c < 3; ++c) image.floats.push_back(static_cast<float>(p[c]) * unit);
      }
    }
    return image;
  }

 private:
  using Pixel = std::array<uint8_t, 4>;

  [[noreturn]] void fail(const std::string& message) const { throw InputError({file_}, message); }

  std::string_view text_line() {
    const size_t end = data_.find('\n', next_);
    if (end == std::string_view::npos) fail("the RGBE file ends inside its header");
    const std::string_view line = data_.substr(next_, end - next_);
    next_ = end + 1;
    return line;
  }

  // Lines up to an empty one, then "-Y height +X width".
  void read_header() {
    for (std::string_view line = text_line(); !line.empty() && line != "\r"; line = text_line()) {
      if (line.starts_with("FORMAT=") && !line.starts_with("FORMAT=32-bit_rle_rgbe")) {
        fail("is a Radiance file of " + std::string(line) + " (known: 32-bit_rle_rgbe)");
      }
    }
    const std::string size(text_line());
    const std::vector<std::string_view> words = split(size, " \r");
    const auto number = [&](size_t i) { return parse_integer(words[i]); };
    if (words.size() != 4 || words[0] != "-Y" || words[2] != "+X" || !number(1) || !number(3) ||
        *number(1) < 0 || *number(3) < 0) {
      fail("the RGBE file has no size \"-Y HEIGHT +X WIDTH\"");
    }
    height_ = static_cast<uint64_t>(*number(1));
    width_ = static_cast<uint64_t>(*number(3));
  }

  uint8_t byte() {
    if (next_ == data_.size()) fail("the RGBE file is truncated");
    return static_cast<uint8_t>(data_[next_++]);
  }
  Pixel pixel() {
    Pixel p{};
    for (uint8_t& component : p) component = byte();
    return p;
  }

  void read_line(std::vector<Pixel>& line) {
    const Pixel first = pixel();
    if (first[0] != 2 || first[1] != 2 || first[2] >= 128) return read_old_line(first, line);
    if ((uint64_t{first[2]} << 8 | first[3]) != width_) fail("the RGBE file is damaged");
    for (size_t component = 0; component < 4; ++component) {
      for (uint64_t x = 0; x < width_;) {
        const uint8_t count = byte();
        const bool run = count > 128;
        const uint64_t length = run ? count - 128 : count;
        if (length == 0 || length > width_ - x) fail("the RGBE file is damaged");
        uint8_t value = run ? byte() : uint8_t{0};
        for (uint64_t k = 0; k < length; ++k) {
          if (!run) value = byte();
          line[x++][component] = value;
        }
      }
    }
  }

  // Pixels one by one; 1, 1, 1, n repeats the pixel before n times, and such marks that follow each
  // other count by powers of 256.
  void read_old_line(Pixel p, std::vector<Pixel>& line) {
    int shift = 0;
    for (uint64_t x = 0;;) {
      if (p[0] == 1 && p[1] == 1 && p[2] == 1) {
        const uint64_t count = uint64_t{p[3]} << shift;
        if (x == 0 || shift > 24 || count > width_ - x) fail("the RGBE file is damaged");
        for (uint64_t k = 0; k < count; ++k, ++x) line[x] = line[x - 1];
        shift += 8;
      } else {
        line[x++] = p;
        shift = 0;
      }
      if (x == width_) return;
      p = pixel();
    }
  }

  const std::string& file_;
  std::string_view data_;
  size_t next_ = 0;
  uint64_t width_ = 0, height_ = 0;
};

}  // namespace

StoredImage read_rgbe(const std::string& file, std::string_view data) {
  return RgbeReader(file, data).read();
}

}  // namespace limn
