#pragma once
// How bright an environment is on average over cones of directions: an importance for edges seen
// before it.
#include <functional>
#include <span>
#include <vector>

#include "limn/core/vec.h"

namespace limn {

// Means of a function of direction over the texels of an octahedral map (Praun and Hoppe 2003) at
// every resolution from 1 to 2^levels squared. Texels differ in solid angle by up to a factor of 5;
// means are by solid angle.
class RadiancePyramid {
 public:
  // luminance: >= 0, of a unit direction. Evaluated at `samples` squared points of each of the
  // finest texels.
  RadiancePyramid(const std::function<double(const Vec3d&)>& luminance, int levels, int samples);

  // Approximate mean over the cone of directions around d (any length but 0) whose half-angle has
  // the given tangent: interpolated between the four texels nearest to d on the level where texels
  // are about as wide as the cone.
  float mean(float dx, float dy, float dz, float tangent) const;
  // Over the whole sphere.
  float mean() const { return texels_.front(); }

  int levels() const { return levels_; }
  // Of all levels, the coarsest first: level l, 2^l by 2^l of them, begins at (4^l - 1) / 3.
  std::span<const float> texels() const { return texels_; }

 private:
  int levels_;
  std::vector<float> texels_;
};

}  // namespace limn
