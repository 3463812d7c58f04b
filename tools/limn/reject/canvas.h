#pragma once
// Drawing over a linear image: antialiased lines and discs.
#include <cstdint>
#include <vector>

#include "limn/core/image.h"
#include "limn/core/vec.h"

namespace limn {

using Color = Rgb<double>;  // linear Rec.709

// From sRGB, 0xrrggbb; and the same as "#rrggbb".
Color srgb(uint32_t hex);
std::string css(uint32_t hex);

// In pixels from the top left corner of the picture; centers of pixels are at halves.
struct PixelPoint {
  double x = 0, y = 0;
};

// How much of each pixel the strokes of one colour cover, in [0, 1]. Strokes that overlap cover no
// more than the strongest one.
class Layer {
 public:
  Layer(int width, int height) : width_(width), height_(height), cover_(cells()) {}

  // With round ends, `width` pixels wide.
  void line(const PixelPoint& a, const PixelPoint& b, double width);
  void disc(const PixelPoint& center, double diameter) { line(center, center, diameter); }
  double cover(int x, int y) const { return cover_[static_cast<size_t>(y) * width_ + x]; }
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  size_t cells() const { return static_cast<size_t>(width_) * height_; }
  int width_, height_;
  std::vector<float> cover_;
};

Color pixel(const Image& image, int x, int y);
void set_pixel(Image& image, int x, int y, const Color& color);
// opacity: of a covered pixel, in [0, 1]
void paint(Image& image, const Layer& layer, const Color& color, double opacity = 1);

}  // namespace limn
