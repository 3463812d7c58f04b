#pragma once
// Images in memory and on disk.
#include <cstdint>
#include <string>
#include <vector>

namespace limn {

// Images that are read and films may have as many.
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

// OpenEXR, scanline, ZIP. Channels R G B for three channels, Y for one (no other number is).
// Attributes are written as string attributes of the header. Files are written under a temporary
// name and renamed, so that a crash never leaves half a file. Throw InputError with the file's
// name.
struct ImageAttribute {
  std::string name;
  std::string value;
};
void write_exr(const std::string& file, const Image& image, bool half,
               const std::vector<ImageAttribute>& attributes);
// Any scanline or tiled EXR with channels R G B (or Y) of half or float: three channels (or one),
// at most kMaxPixels pixels. Sizes are held against the file's before memory is taken.
Image read_exr(const std::string& file);
// The string attributes of its header.
std::vector<ImageAttribute> read_exr_attributes(const std::string& file);

// 8-bit sRGB picture of radiance: clamped to [0, 1] after multiplication with `exposure`.
void write_png(const std::string& file, const Image& image, double exposure);
// Blue-white-red picture of a signed image (mean over channels): white is 0, saturated is +-scale.
void write_signed_png(const std::string& file, const Image& image, double scale);
// The scale for write_signed_png: the 99.5th percentile of the non-zero |mean over channels|; 1 if
// all are zero.
double signed_scale(const Image& image);

}  // namespace limn
