// Means of an environment over cones, by a pyramid of octahedral maps.
#include "limn/edgetree/radiance_pyramid.h"

#include <cmath>

#include "edgetree/light/light_term.h"

namespace limn {
namespace {

// The (unnormalised) direction at (u, v) in [-1, 1]^2: the octahedron |x| + |y| + |z| = 1 with its
// lower half unfolded.
Vec3d octahedral_direction(double u, double v) {
  const double z = 1 - std::fabs(u) - std::fabs(v);
  if (z >= 0) return {u, v, z};
  return {std::copysign(1 - std::fabs(v), u), std::copysign(1 - std::fabs(u), v), z};
}

Floats with_sign_of(Floats magnitude, Floats sign) {
  return (Floats)(((Ints)magnitude & INT32_MAX) | ((Ints)sign & INT32_MIN));
}

Floats gather(const float* texels, Ints index) {
  Floats result;
  for (int i = 0; i < kWidth; ++i) result[i] = texels[index[i]];
  return result;
}

}  // namespace

RadiancePyramid::RadiancePyramid(const std::function<double(const Vec3d&)>& luminance, int levels,
                                 int samples)
    : levels_(levels), texels_(((size_t{4} << 2 * levels) - 1) / 3) {
  const int size = 1 << levels;
  std::vector<double> sums(static_cast<size_t>(size) * size);
  std::vector<double> weights(sums.size());
  for (int y = 0; y < size * samples; ++y) {
    for (int x = 0; x < size * samples; ++x) {
      const double step = 2.0 / (size * samples);
      const Vec3d d = octahedral_direction((x + 0.5) * step - 1, (y + 0.5) * step - 1);
      const double r = length(d);
      // Faces of the octahedron have equal distances from its center, so the solid angle is
      // proportional to 1 / r^3.
      const double weight = 1 / (r * r * r);
      const size_t texel = static_cast<size_t>(y / samples) * size + x / samples;
      sums[texel] += weight * luminance(d / r);
      weights[texel] += weight;
    }
  }
  for (int level = levels;; --level) {
    const int width = 1 << level;
    const size_t first = ((size_t{1} << 2 * level) - 1) / 3;
    for (size_t i = 0; i < sums.size(); ++i) {
      texels_[first + i] = static_cast<float>(sums[i] / weights[i]);
    }
    if (level == 0) return;
    std::vector<double> coarse_sums(sums.size() / 4);
    std::vector<double> coarse_weights(sums.size() / 4);
    for (int y = 0; y < width; ++y) {
      for (int x = 0; x < width; ++x) {
        const size_t fine = static_cast<size_t>(y) * width + x;
        const size_t coarse = static_cast<size_t>(y / 2) * (width / 2) + x / 2;
        coarse_sums[coarse] += sums[fine];
        coarse_weights[coarse] += weights[fine];
      }
    }
    sums = std::move(coarse_sums);
    weights = std::move(coarse_weights);
  }
}

float RadiancePyramid::mean(float dx, float dy, float dz, float tangent) const {
  return means(*this, {splat(dx), splat(dy), splat(dz)}, splat(tangent))[0];
}

Floats means(const RadiancePyramid& pyramid, const Floats3& d, Floats tangent) {
  // 4^l texels share 4 pi: a texel of level l has the solid angle of a cone of tangent 2 * 2^-l.
  const Floats ratio = 1.41f / max(tangent, splat(1e-6f));
  Ints level = ((Ints)ratio >> 23) - 126;  // its exponent
  level = level > 0 ? level : Ints{};
  level = level < pyramid.levels() ? level : Ints{} + pyramid.levels();
  const Floats inverse = 1 / (abs(d.x) + abs(d.y) + abs(d.z));
  const Floats u = d.x * inverse, v = d.y * inverse;
  const Floats u_folded = with_sign_of(1 - abs(v), u), v_folded = with_sign_of(1 - abs(u), v);
  const Ints below = d.z < 0;
  const Ints one = Ints{} + 1, size = one << level;
  const Floats width = to_float(size), zero = splat(0.0f);
  const Floats x = clamp((select(below, u_folded, u) + 1) * 0.5f * width - 0.5f, zero, width - 1);
  const Floats y = clamp((select(below, v_folded, v) + 1) * 0.5f * width - 0.5f, zero, width - 1);
  const Ints x0 = __builtin_convertvector(x, Ints), y0 = __builtin_convertvector(y, Ints);
  const Ints x1 = x0 + 1 < size ? x0 + 1 : x0, y1 = y0 + 1 < size ? y0 + 1 : y0;
  const Floats fx = x - to_float(x0), fy = y - to_float(y0);
  const Ints first = ((one << 2 * level) - 1) & 0x55555555;  // (4^level - 1) / 3
  const Ints row0 = first + (y0 << level), row1 = first + (y1 << level);
  const float* t = pyramid.texels().data();
  const Floats top = gather(t, row0 + x0) * (1 - fx) + gather(t, row0 + x1) * fx;
  const Floats bottom = gather(t, row1 + x0) * (1 - fx) + gather(t, row1 + x1) * fx;
  return top * (1 - fy) + bottom * fy;
}

}  // namespace limn
