// Means of an environment over cones, by an octahedral pyramid.
#include "limn/edgetree/radiance_pyramid.h"

#include <algorithm>
#include <cmath>

namespace limn {
namespace {

// The direction (not of unit length) at (u, v) in [-1, 1]^2: the octahedron |x| + |y| + |z| = 1,
// its lower half folded out.
Vec3d octahedral_direction(double u, double v) {
  const double z = 1 - std::fabs(u) - std::fabs(v);
  if (z >= 0) return {u, v, z};
  return {std::copysign(1 - std::fabs(v), u), std::copysign(1 - std::fabs(u), v), z};
}

}  // namespace

RadiancePyramid::RadiancePyramid(const std::function<double(const Vec3d&)>& luminance, int levels,
                                 int samples)
    : levels_(levels), texels_(levels + 1) {
  const int size = 1 << levels;
  std::vector<double> sums(static_cast<size_t>(size) * size);
  std::vector<double> weights(sums.size());
  for (int y = 0; y < size * samples; ++y) {
    for (int x = 0; x < size * samples; ++x) {
      const double step = 2.0 / (size * samples);
      const Vec3d d = octahedral_direction((x + 0.5) * step - 1, (y + 0.5) * step - 1);
      const double r = length(d);
      // Every face of the octahedron has the same distance from its center: solid angle goes with
      // 1 / r^3.
      const double weight = 1 / (r * r * r);
      const size_t texel = static_cast<size_t>(y / samples) * size + x / samples;
      sums[texel] += weight * luminance(d / r);
      weights[texel] += weight;
    }
  }
  for (int level = levels;; --level) {
    const int width = 1 << level;
    texels_[level].resize(sums.size());
    for (size_t i = 0; i < sums.size(); ++i) {
      texels_[level][i] = static_cast<float>(sums[i] / weights[i]);
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
  // 4^l texels share 4 pi: a texel of level l has the solid angle of a cone of tangent 2 * 2^-l.
  int level = 0;
  std::frexp(1.41f / std::max(tangent, 1e-6f), &level);
  level = std::clamp(level, 0, levels_);
  const float inverse = 1 / (std::fabs(dx) + std::fabs(dy) + std::fabs(dz));
  float u = dx * inverse;
  float v = dy * inverse;
  if (dz < 0) {
    const float folded = std::copysign(1 - std::fabs(v), u);
    v = std::copysign(1 - std::fabs(u), v);
    u = folded;
  }
  const int size = 1 << level;
  const float x = std::clamp((u + 1) * 0.5f * size - 0.5f, 0.0f, size - 1.0f);
  const float y = std::clamp((v + 1) * 0.5f * size - 0.5f, 0.0f, size - 1.0f);
  const int x0 = static_cast<int>(x);
  const int y0 = static_cast<int>(y);
  const int x1 = std::min(x0 + 1, size - 1);
  const int y1 = std::min(y0 + 1, size - 1);
  const float fx = x - x0;
  const float fy = y - y0;
  const std::vector<float>& t = texels_[level];
  const float top = t[y0 * size + x0] * (1 - fx) + t[y0 * size + x1] * fx;
  const float bottom = t[y1 * size + x0] * (1 - fx) + t[y1 * size + x1] * fx;
  return top * (1 - fy) + bottom * fy;
}

}  // namespace limn
