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
  double luminance;  // mean over the cap
};

// Disjoint caps of a few degrees that are much brighter than the environment is on average and hold
// a good part of the integral of its squared luminance each (not of its light: a low sun in haze
// has 2 % of that, and rules the error), in that order. Found among directions that the
// environment itself draws, the same each time.
std::vector<BrightPatch> find_bright_patches(const Environment& environment);
// Whether there is any: that asks for less work.
bool has_bright_patch(const Environment& environment);

}  // namespace limn
