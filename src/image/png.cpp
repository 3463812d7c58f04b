// Writing of PNG files; the only file that includes libpng.
#include <png.h>

#include <algorithm>
#include <cmath>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/output_file.h"

namespace limn {
namespace {

// pixels: height x width x 3, 8-bit sRGB.
void write_bytes(const std::string& file, int width, int height,
                 const std::vector<png_byte>& pixels) {
  OutputFile output(file);
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(width);
  png.height = static_cast<png_uint_32>(height);
  png.format = PNG_FORMAT_RGB;
  if (!png_image_write_to_file(&png, output.temporary().c_str(), 0, pixels.data(), 0, nullptr)) {
    throw InputError(SourceLocation{file}, std::string("cannot write: ") + png.message);
  }
  output.commit();
}

// x in [0, 1]; NaN becomes 0.
png_byte to_byte(double x) {
  return x > 0 ? static_cast<png_byte>(std::lround(255 * std::min(x, 1.0))) : png_byte{0};
}

// The transfer function of sRGB, IEC 61966-2-1.
double srgb_encode(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double channel_mean(const Image& image, int x, int y) {
  double sum = 0;
  for (int c = 0; c < image.channels; ++c) sum += image.at(x, y, c);
  return sum / image.channels;
}

}  // namespace

void write_png(const std::string& file, const Image& image, double exposure) {
  std::vector<png_byte> pixels;
  pixels.reserve(static_cast<size_t>(3) * image.width * image.height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double v = image.at(x, y, std::min(c, image.channels - 1)) * exposure;
        pixels.push_back(to_byte(srgb_encode(v)));
      }
    }
  }
  write_bytes(file, image.width, image.height, pixels);
}

void write_signed_png(const std::string& file, const Image& image, double scale) {
  std::vector<png_byte> pixels;
  pixels.reserve(static_cast<size_t>(3) * image.width * image.height);
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double t = channel_mean(image, x, y) / scale;
      pixels.push_back(to_byte(1 + std::min(t, 0.0)));
      pixels.push_back(to_byte(1 - std::fabs(t)));
      pixels.push_back(to_byte(1 - std::max(t, 0.0)));
    }
  }
  write_bytes(file, image.width, image.height, pixels);
}

double signed_scale(const Image& image) {
  std::vector<double> sizes;
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double size = std::fabs(channel_mean(image, x, y));
      if (size > 0 && std::isfinite(size)) sizes.push_back(size);
    }
  }
  if (sizes.empty()) return 1;
  const std::ptrdiff_t rank = std::lround(0.995 * static_cast<double>(sizes.size() - 1));
  std::nth_element(sizes.begin(), sizes.begin() + rank, sizes.end());
  return sizes[rank];
}

}  // namespace limn
