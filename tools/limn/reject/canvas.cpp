// Lines, discs and polygons, smoothed by coverage.
#include "tools/limn/reject/canvas.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// IEC 61966-2-1.
double decode(uint32_t byte) {
  const double v = byte / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

double distance_to_segment(const PixelPoint& p, const PixelPoint& a, const PixelPoint& b) {
  const double dx = b.x - a.x, dy = b.y - a.y, square = dx * dx + dy * dy;
  const double along = square > 0 ? ((p.x - a.x) * dx + (p.y - a.y) * dy) / square : 0;
  const double t = std::clamp(along, 0.0, 1.0);
  return std::hypot(a.x + t * dx - p.x, a.y + t * dy - p.y);
}

}  // namespace

Color srgb(uint32_t hex) {
  return {decode(hex >> 16 & 255), decode(hex >> 8 & 255), decode(hex & 255)};
}

std::string css(uint32_t hex) { return fmt::format("#{:06x}", hex); }

void Layer::line(const PixelPoint& a, const PixelPoint& b, double width) {
  const double reach = 0.5 * width + 0.5;
  const auto first = [&](double u, double v) { return std::max(std::min(u, v) - reach, 0.0); };
  const auto last = [&](double u, double v, int end) {
    return static_cast<int>(std::min(std::max(u, v) + reach, end - 1.0));
  };
  for (int y = static_cast<int>(first(a.y, b.y)); y <= last(a.y, b.y, height_); ++y) {
    for (int x = static_cast<int>(first(a.x, b.x)); x <= last(a.x, b.x, width_); ++x) {
      const double d = distance_to_segment({x + 0.5, y + 0.5}, a, b);
      float& cell = cover_[static_cast<size_t>(y) * width_ + x];
      cell = std::max(cell, static_cast<float>(std::clamp(reach - d, 0.0, 1.0)));
    }
  }
}

Color pixel(const Image& image, int x, int y) {
  return {image.at(x, y, 0), image.at(x, y, 1), image.at(x, y, 2)};
}

void set_pixel(Image& image, int x, int y, const Color& color) {
  for (int c = 0; c < 3; ++c) image.at(x, y, c) = static_cast<float>(color[c]);
}

void paint(Image& image, const Layer& layer, const Color& color, double opacity) {
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const double alpha = layer.cover(x, y) * opacity;
      if (alpha > 0) set_pixel(image, x, y, pixel(image, x, y) * (1 - alpha) + color * alpha);
    }
  }
}

}  // namespace limn
