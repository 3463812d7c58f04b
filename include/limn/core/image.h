#pragma once
// Images in memory and on disk.
#include <cstdint>
#include <string>
#include <vector>

namespace limn {

// Upper limit for films and for images that are read.
inline constexpr int64_t kMaxPixels = int64_t{1} << 28;  // not tuned: 3 GB in memory

// H rows of W pixels of C interleaved channels, row 0 on top, linear.
struct Image {
  int width = 0;
  int height = 0;
  int channels = 3;
  std::vector<float> data;

  Image() = default;
  Image(int w, int h, int c)
      : width(w), height(h), channels(c), data(static_cast<size_t>(w) * h * c) {}
  float& at(int x, int y, int c) {
    return data[(static_cast<size_t>(y) * width + x) * channels + c];
  }
  float at(int x, int y, int c) const {
    return data[(static_cast<size_t>(y) * width + x) * channels + c];
  }
};

// An image as its file stores it: bytes where the file has eight bits (b means b / 255), else
// floats. C is 1 or 3 interleaved channels, row 0 on top.
struct StoredImage {
  int width = 0;
  int height = 0;
  int channels = 3;
  bool srgb = false;           // the numbers are encoded by sRGB's transfer function, not linear
  std::vector<uint8_t> bytes;  // one of the two is empty
  std::vector<float> floats;
};
// Reads EXR, PNG (8 and 16 bits), JPEG, RGBE (Radiance) or uncompressed BMP, distinguished by their
// first bytes, of at most kMaxPixels pixels. Alpha is dropped. Sizes in the header are checked
// against the file's size before memory is allocated. InputError names the file.
StoredImage read_stored_image(const std::string& file);
// Reads an image of any known format as linear floats.
Image read_image(const std::string& file);
// InputError at a pixel that is not finite. what: "the texture", for the message.
void check_finite(const StoredImage& image, const std::string& file, const std::string& what);
void check_finite(const Image& image, const std::string& file, const std::string& what);
// The transfer function of sRGB, IEC 61966-2-1, and its inverse.
inline constexpr double kSrgbLinear = 0.0031308;  // up to there sRGB's curve is a line
double srgb_encode(double linear);
double srgb_decode(double encoded);

// Writes OpenEXR: scanline, ZIP; channels R G B for three channels, Y for one (no other number is
// allowed). Attributes become string attributes of the header. Files are written under a
// temporary name and renamed, so an interruption leaves no partial file. InputError names the
// file.
struct ImageAttribute {
  std::string name;
  std::string value;
};
void write_exr(const std::string& file, const Image& image, bool half,
               const std::vector<ImageAttribute>& attributes);
// Reads a scanline or tiled EXR with channels R G B (or Y), half or float, of at most kMaxPixels
// pixels. Sizes in the header are checked against the file's size before memory is allocated.
Image read_exr(const std::string& file);
// The string attributes of the file's header.
std::vector<ImageAttribute> read_exr_attributes(const std::string& file);

// Writes an 8-bit sRGB image: radiance times `exposure`, clamped to [0, 1].
void write_png(const std::string& file, const Image& image, double exposure);
// Writes a signed image (mean over channels) in blue-white-red: white is 0, saturation +-scale.
void write_signed_png(const std::string& file, const Image& image, double scale);
// A scale for write_signed_png: the 99.5th percentile of the non-zero absolute channel means; 1 if
// all are zero.
double signed_scale(const Image& image);

// The alpha channel of a PNG or EXR image as its file stores it (1: opaque), H by W by 1; without
// pixels where the file has none, and for other formats. InputError as read_image().
Image read_alpha(const std::string& file);

// As write_exr(), with alpha (H by W by 1) as channel A.
void write_exr_with_alpha(const std::string& file, const Image& image, const Image& alpha,
                          bool half, const std::vector<ImageAttribute>& attributes);

// A layer's channels are named NAME.A, NAME.B, ...
struct ImageLayer {
  std::string name;
  std::string channels;  // "XYZ": one letter for each channel of the image, in alphabetical order
  Image image;
};
// As write_exr(), in single precision. layers: of one size, at least one.
void write_exr_layers(const std::string& file, const std::vector<ImageLayer>& layers,
                      const std::vector<ImageAttribute>& attributes);

}  // namespace limn
