#pragma once
// Axis-aligned bounds of points.
#include <algorithm>

#include "limn/core/vec.h"

namespace limn {

// Empty until the first point: lower > upper, and only extend means anything.
struct Bounds {
  Vec3d lower{1e300, 1e300, 1e300};
  Vec3d upper{-1e300, -1e300, -1e300};

  void extend(const Vec3d& p) {
    for (int k = 0; k < 3; ++k) {
      lower[k] = std::min(lower[k], p[k]);
      upper[k] = std::max(upper[k], p[k]);
    }
  }
  Vec3d center() const { return (lower + upper) * 0.5; }
  double diagonal() const { return length(upper - lower); }
};

}  // namespace limn
