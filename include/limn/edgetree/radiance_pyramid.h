#pragma once
// The mean luminance of an environment over cones of directions, as an importance for edges in
// front of it.
#include <functional>
#include <span>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

// Means of a function of direction over the texels of an octahedral map (Praun and Hoppe 2003), at
// every resolution from 1 to 2^levels squared. Means are weighted by solid angle, which differs
// between texels by up to a factor of 5.
class RadiancePyramid {
 public:
  // luminance: >= 0, of a unit direction. It is evaluated at `samples` squared points per texel of
  // the finest level.
  RadiancePyramid(const std::function<double(const Vec3d&)>& luminance, int levels, int samples);

  // Approximate mean over the cone around d (of any nonzero length) with the given tangent of its
  // half-angle. Interpolates the four texels nearest to d on the level whose texels are about as
  // wide as the cone.
  float mean(float dx, float dy, float dz, float tangent) const;
  // Mean over the whole sphere.
  float mean() const { return texels_.front(); }

  int levels() const { return levels_; }
  // The texels of all levels, coarsest first: level l has 2^l by 2^l, from index (4^l - 1) / 3.
  std::span<const float> texels() const { return texels_; }

 private:
  int levels_;
  std::vector<float> texels_;
};

}  // namespace limn
