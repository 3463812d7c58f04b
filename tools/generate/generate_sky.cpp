// Skies for the emitter `envmap`, +y up.
#include <cmath>

#include "tools/generate/generate_kinds.h"

namespace limn {
namespace {

using Colour = Rgb<double>;

// The map's texel (column, row) looks along this direction; fractions lie in between.
Vec3d texel_direction(const Image& image, double column, double row) {
  const double theta = kPi * row / (image.height - 1);
  const double phi = 2 * kPi * (column + 0.5) / image.width;
  return {std::sin(phi) * std::sin(theta), std::cos(theta), -std::cos(phi) * std::sin(theta)};
}

// The mean of radiance(d) over subsamples^2 directions of every texel.
template <class F>
Image make_map(int width, int height, int subsamples, const F& radiance) {
  Image image(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      Colour sum;
      for (int k = 0; k < subsamples * subsamples; ++k) {
        const double dx = (k % subsamples + 0.5) / subsamples - 0.5;
        const double dy = (k / subsamples + 0.5) / subsamples - 0.5;
        sum += radiance(texel_direction(image, x + dx, y + dy));
      }
      for (int c = 0; c < 3; ++c) {
        image.at(x, y, c) = static_cast<float>(sum[c] / (subsamples * subsamples));
      }
    }
  }
  return image;
}

// Blue above, bright at the horizon, brown earth below.
Colour clear_air(const Vec3d& d) {
  const double glow = std::exp(-6 * std::fmax(0.0, d.y));
  const Colour air{0.18 + 1.1 * glow, 0.32 + 0.75 * glow, 0.6 + 0.35 * glow};
  if (d.y >= 0) return air;
  return air * std::exp(12 * d.y) + Colour{0.12, 0.08, 0.05} * (-std::expm1(12 * d.y));
}

}  // namespace

// Clouds lit from one side: no direction is more than ten times as bright as another.
Image make_soft_sky() {
  return make_map(256, 128, 1, [](const Vec3d& d) {
    const double lit = std::exp(2.5 * (dot(d, normalize(Vec3d{0.7, 0.45, 0.75})) - 1));
    const double banks = 0.5 + 0.5 * std::sin(6 * d.x + 4 * d.y) * std::sin(5 * d.z - 7 * d.y + 1);
    return clear_air(d) * (0.55 + 0.35 * banks) + Colour{1.9, 1.45, 1.0} * lit;
  });
}

// A sun of 1.5 degrees radius, thousands of times as bright as the air around it: most light comes
// from it.
Image make_sun_sky() {
  const double edge = std::cos(1.5 * kPi / 180);
  return make_map(1024, 512, 2, [&](const Vec3d& d) {
    const double cosine = dot(d, normalize(Vec3d{0.55, 0.62, 0.56}));
    const Colour air = clear_air(d) * 0.7 + Colour{0.8, 0.6, 0.4} * std::exp(60 * (cosine - 1));
    return cosine > edge ? air + Colour{4200, 3700, 2900} : air;
  });
}

}  // namespace limn
