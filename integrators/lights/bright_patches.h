#pragma once
// Small bright patches of an environment: the sun.
#include <vector>

#include "limn/core/environment.h"

namespace limn {

// All directions within an angle of an axis.
struct DirectionCap {
  Vec3d axis{0, 0, 1};          // unit
  double sine = 0, cosine = 1;  // of the angle, which is less than a right one
  bool holds(const Vec3d& w) const { return dot(w, axis) >= cosine; }  // w: unit
};

struct BrightPatch {
  DirectionCap cap;
  double luminance = 0;  // mean over what it holds
  // The cosine of the part around the axis that belongs to another patch: the sun in its
  // glow. None: no cosine is so large.
  double inner_cosine = 2;

  bool is_ring() const { return inner_cosine <= 1; }
  bool holds(const Vec3d& w) const { return cap.holds(w) && dot(w, cap.axis) < inner_cosine; }
  double inner_versine() const { return is_ring() ? 1 - inner_cosine : 0; }
};

// Caps of a few degrees that are much brighter than the environment is on average and hold a good
// part of the integral of its squared luminance each (not of its light: a low sun in haze has 2 %
// of that, and rules the error), in that order; behind each the ring around it, if what glows there
// is such a part by itself. No two hold the same direction. Found among directions that the
// environment itself draws, the same each time.
std::vector<BrightPatch> find_bright_patches(const Environment& environment);
// Whether there is any: that takes less work.
bool has_bright_patch(const Environment& environment);

}  // namespace limn
