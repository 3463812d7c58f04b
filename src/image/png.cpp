// Reading and writing of PNG files; the only file that includes libpng.
#include <png.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <csetjmp>
#include <cstring>

#include "limn/core/error.h"
#include "limn/core/image.h"
#include "limn/core/output_file.h"
#include "src/image/formats.h"

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

double channel_mean(const Image& image, int x, int y) {
  double sum = 0;
  for (int c = 0; c < image.channels; ++c) sum += image.at(x, y, c);
  return sum / image.channels;
}

// Decodes a file in memory. libpng leaves its functions by longjmp after an error, so between here
// and there nothing may need a destructor.
class PngReader {
 public:
  explicit PngReader(std::string_view data) : left_(data) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, this, on_error, on_warning);
    info_ = png_ ? png_create_info_struct(png_) : nullptr;
    if (!info_) {
      png_destroy_read_struct(&png_, nullptr, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  uint32_t width = 0, height = 0;
  int channels = 0;
  bool wide = false;  // two bytes a number, else one
  bool has_alpha = false;
  const char* message = "";  // of an error

  // Sets the members above; false after an error.
  // keeps_alpha: each pixel's numbers end in its opacity, of a file that says any.
  bool read_header(bool keeps_alpha) {
    if (setjmp(png_jmpbuf(png_))) return false;  // NOLINT: libpng has no other way
    png_set_read_fn(png_, this, on_read);
    png_set_user_limits(png_, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    // Profiles, texts and times are passed over, not inflated.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    width = png_get_image_width(png_, info_);
    height = png_get_image_height(png_, info_);
    channels = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_COLOR) != 0 ? 3 : 1;
    wide = png_get_bit_depth(png_, info_) == 16;
    has_alpha = (png_get_color_type(png_, info_) & PNG_COLOR_MASK_ALPHA) != 0 ||
                png_get_valid(png_, info_, PNG_INFO_tRNS) != 0;
    keeps_alpha_ = keeps_alpha && has_alpha;
    if (keeps_alpha_) ++channels;
    return true;
  }
  // numbers: of all rows, after a header of this size.
  bool read_rows(png_byte* numbers) {
    if (setjmp(png_jmpbuf(png_))) return false;  // NOLINT
    png_set_palette_to_rgb(png_);
    png_set_expand_gray_1_2_4_to_8(png_);
    if (keeps_alpha_) {
      png_set_tRNS_to_alpha(png_);
    } else {
      png_set_strip_alpha(png_);
    }
    if (std::endian::native == std::endian::little) png_set_swap(png_);
    const int passes = png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);  // takes memory for a row
    const size_t row = size_t{width} * static_cast<size_t>(channels) * (wide ? 2 : 1);
    for (int pass = 0; pass < passes; ++pass) {
      for (uint32_t y = 0; y < height; ++y) png_read_row(png_, numbers + y * row, nullptr);
    }
    png_read_end(png_, nullptr);
    return true;
  }

 private:
  static void on_read(png_structp png, png_bytep out, size_t size) {
    auto* const reader = static_cast<PngReader*>(png_get_io_ptr(png));
    if (size > reader->left_.size()) png_error(png, "the file ends too early");
    std::memcpy(out, reader->left_.data(), size);
    reader->left_.remove_prefix(size);
  }
  [[noreturn]] static void on_error(png_structp png, png_const_charp message) {
    auto* const reader = static_cast<PngReader*>(png_get_error_ptr(png));
    std::snprintf(reader->text_, sizeof(reader->text_), "%s", message);
    reader->message = reader->text_;
    png_longjmp(png, 1);
  }
  static void on_warning(png_structp, png_const_charp) {}

  std::string_view left_;
  bool keeps_alpha_ = false;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  char text_[200] = "";
};

// All numbers of the file, bytes or floats.
StoredImage decode(const std::string& file, std::string_view data, PngReader& reader,
                   bool keeps_alpha) {
  const auto check = [&](bool read) {
    if (read) return;
    throw InputError({file},
                     std::string("the PNG file is truncated or damaged: ") + reader.message);
  };
  check(reader.read_header(keeps_alpha));
  // A byte inflates to at most 1032, and a pixel takes at least a bit.
  constexpr double kPixelsPerByte = 8 * 1032.0;
  const double pixel = reader.channels * (reader.wide ? 6.0 : 1.0);
  check_image_size(file, data, reader.width, reader.height, kPixelsPerByte, pixel);
  StoredImage image{static_cast<int>(reader.width),
                    static_cast<int>(reader.height),
                    reader.channels,
                    true,
                    {},
                    {}};
  const size_t count = size_t{reader.width} * reader.height * static_cast<size_t>(reader.channels);
  if (!reader.wide) {
    image.bytes.resize(count);
    check(reader.read_rows(image.bytes.data()));
    return image;
  }
  std::vector<uint16_t> numbers(count);
  check(reader.read_rows(reinterpret_cast<png_byte*>(numbers.data())));
  image.floats.reserve(count);
  for (const uint16_t v : numbers) image.floats.push_back(static_cast<float>(v) / 65535.0f);
  return image;
}

}  // namespace

StoredImage read_png(const std::string& file, std::string_view data) {
  PngReader reader(data);
  return decode(file, data, reader, false);
}

Image read_png_alpha(const std::string& file, std::string_view data) {
  PngReader reader(data);
  const StoredImage all = decode(file, data, reader, true);
  if (!reader.has_alpha) return {};
  Image alpha(all.width, all.height, 1);
  for (size_t i = 0; i < alpha.data.size(); ++i) {
    const size_t at = (i + 1) * static_cast<size_t>(all.channels) - 1;
    alpha.data[i] = all.bytes.empty() ? all.floats[at] : static_cast<float>(all.bytes[at]) / 255.0f;
  }
  return alpha;
}

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
