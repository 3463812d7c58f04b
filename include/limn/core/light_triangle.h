#pragma once
// A piece of a light's outline, for those who choose edges by the light behind them.
#include "limn/core/vec.h"

namespace limn {

// A triangle of an emitter [scene units], wound counter-clockwise seen from where it shines.
struct LightTriangle {
  Vec3d corners[3];
  double luminance = 0;
};

}  // namespace limn
