// Images of any format that is known, distinguished by their first bytes.
#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/memory.h"
#include "src/base/text.h"
#include "src/image/formats.h"

namespace limn {
namespace {

struct ImageFormat {
  std::string_view begins;
  StoredImage (*read)(const std::string& file, std::string_view data);
};

constexpr ImageFormat kFormats[] = {
    {"\x89PNG\r\n\x1a\n", read_png},
    {"\xff\xd8\xff", read_jpeg},
    {"#?", read_rgbe},
    {"BM", read_bmp},
};
constexpr std::string_view kExr = "\x76\x2f\x31\x01";

std::string first_bytes(const std::string& file) {
  errno = 0;
  std::ifstream stream(file, std::ios::binary);
  if (!stream.is_open()) {
    throw InputError({file}, std::string("cannot read: ") + std::strerror(errno));
  }
  std::string bytes(8, '\0');
  stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<size_t>(stream.gcount()));
  if (bytes.empty()) throw InputError({file}, "cannot read: the file is empty");
  return bytes;
}

StoredImage stored(Image image) {
  StoredImage of{image.width, image.height, image.channels, false, {}, {}};
  of.floats = std::move(image.data);
  return of;
}

void check_floats(const std::vector<float>& floats, int width, int channels,
                  const std::string& file, const std::string& what) {
  const auto bad =
      std::find_if_not(floats.begin(), floats.end(), [](float v) { return std::isfinite(v); });
  if (bad == floats.end()) return;
  const auto pixel = (bad - floats.begin()) / channels;
  throw InputError({file}, what + "'s pixel (column " + std::to_string(pixel % width) + ", row " +
                               std::to_string(pixel / width) + ") is not finite");
}

}  // namespace

void check_image_size(const std::string& file, std::string_view data, uint64_t width,
                      uint64_t height, double pixels_per_byte, double bytes_per_pixel) {
  const std::string size =
      "the image of " + std::to_string(width) + " x " + std::to_string(height) + " pixels";
  constexpr auto kMost = static_cast<uint64_t>(kMaxPixels);
  if (width == 0 || height == 0) throw InputError({file}, size + " has none");
  if (width > kMost || height > kMost || width * height > kMost) {
    throw InputError({file},
                     size + " is too large (at most " + std::to_string(kMaxPixels) + " pixels)");
  }
  const auto pixels = static_cast<double>(width * height);
  if (pixels > static_cast<double>(data.size()) * pixels_per_byte) {
    throw InputError({file}, size + " cannot come out of a file of " + std::to_string(data.size()) +
                                 " bytes: it is truncated or damaged");
  }
  require_memory({file}, pixels * bytes_per_pixel, size, "use a smaller one");
}

StoredImage read_stored_image(const std::string& file) {
  const std::string first = first_bytes(file);
  if (first.starts_with(kExr)) return stored(read_exr(file));
  for (const ImageFormat& format : kFormats) {
    if (!first.starts_with(format.begins)) continue;
    return format.read(file, read_whole_file(file));
  }
  if (first.starts_with("version ")) read_whole_file(file);  // says what it is
  throw InputError({file}, "is no image that is read (known: BMP, EXR, JPEG, PNG, Radiance RGBE)");
}

Image read_image(const std::string& file) {
  StoredImage stored = read_stored_image(file);
  Image image(stored.width, stored.height, stored.channels);
  if (stored.bytes.empty()) {
    image.data = std::move(stored.floats);
    if (!stored.srgb) return image;
    for (float& v : image.data) v = static_cast<float>(srgb_decode(v));
    return image;
  }
  for (size_t i = 0; i < image.data.size(); ++i) {
    const double v = stored.bytes[i] / 255.0;
    image.data[i] = static_cast<float>(stored.srgb ? srgb_decode(v) : v);
  }
  return image;
}

Image read_alpha(const std::string& file) {
  const std::string first = first_bytes(file);
  if (first.starts_with(kExr)) return read_exr_alpha(file);
  if (!first.starts_with(kFormats[0].begins)) return {};
  return read_png_alpha(file, read_whole_file(file));
}

void check_finite(const StoredImage& image, const std::string& file, const std::string& what) {
  check_floats(image.floats, image.width, image.channels, file, what);
}

void check_finite(const Image& image, const std::string& file, const std::string& what) {
  check_floats(image.data, image.width, image.channels, file, what);
}

double srgb_encode(double linear) {
  return linear <= kSrgbLinear ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double srgb_decode(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace limn
