// Texels in memory: bytes, halves or floats.
#include "src/texture/texels.h"

#include <algorithm>
#include <cmath>

namespace limn {

Texels::Texels(const StoredImage& image) : width_(image.width), height_(image.height) {
  if (image.bytes.empty()) {
    if (!image.srgb) {
      fill_floats(image.floats, image.channels);
    } else {
      std::vector<float> linear = image.floats;
      for (float& v : linear) v = static_cast<float>(srgb_decode(v));
      fill_floats(linear, image.channels);
    }
  } else {
    for (int b = 0; b < 256; ++b) {
      const double v = b / 255.0;
      table_[b] = static_cast<float>(image.srgb ? srgb_decode(v) : v);
    }
    fill<uint8_t>(image.channels, [&](size_t i) { return image.bytes[i]; });
  }
  sum_up();
}

Texels::Texels(const Image& image) : width_(image.width), height_(image.height) {
  fill_floats(image.data, image.channels);
  sum_up();
}

void Texels::fill_floats(const std::vector<float>& floats, int channels) {
  const bool halves = std::all_of(floats.begin(), floats.end(),
                                  [](float v) { return static_cast<float>(Half(v)) == v; });
  if (halves) {
    fill<Half>(channels, [&](size_t i) { return Half(floats[i]); });
  } else {
    fill<float>(channels, [&](size_t i) { return floats[i]; });
  }
}

template <class Number, class Of>
void Texels::fill(int channels, const Of& of) {
  tiles_across_ = (static_cast<size_t>(width_) + kTile - 1) / kTile;
  const size_t tiles_down = (static_cast<size_t>(height_) + kTile - 1) / kTile;
  auto& all = all_.emplace<Quads<Number>>(tiles_across_ * tiles_down * kTile * kTile);
  for (size_t i = 0; i < count(); ++i) {
    const size_t first = i * static_cast<size_t>(channels), width = static_cast<size_t>(width_);
    const size_t g = channels == 3 ? 1 : 0, b = channels == 3 ? 2 : 0;
    all[place(static_cast<uint32_t>(i % width), static_cast<uint32_t>(i / width))] = {
        of(first), of(first + g), of(first + b), Number(0.0f)};
  }
}

void Texels::sum_up() {
  least_ = most_ = texel(0, 0).r;
  for (size_t i = 0; i < count(); ++i) {
    const Rgb<double> texel = in_order(i);
    mean_ += texel;
    for (int c = 0; c < 3; ++c) {
      mean_magnitude_ += std::fabs(texel[c]);
      least_ = std::min(least_, texel[c]);
      most_ = std::max(most_, texel[c]);
    }
  }
  mean_ = mean_ * (1 / static_cast<double>(count()));
  mean_magnitude_ /= 3 * static_cast<double>(count());
}

Image Texels::image() const {
  Image image(width_, height_, 3);
  for (size_t i = 0; i < count(); ++i) {
    const Rgb<double> texel = in_order(i);
    for (int c = 0; c < 3; ++c)
      image.data[3 * i + static_cast<size_t>(c)] = static_cast<float>(texel[c]);
  }
  return image;
}

}  // namespace limn
