#pragma once
// A differentiable value of an object of the scene.
#include <limits>
#include <string>
#include <vector>

#include "limn/core/dual.h"

namespace limn {

// A differentiable value of an object: "alpha", "reflectance", "radiance", ... A colour is
// differentiated along grey: all channels change by the same amount. Channels never mix, so channel
// c of the derivative image is the derivative with respect to channel c.
struct ParameterRef {
  std::string name;
  std::vector<Dual*> values;  // one, or the three channels
  enum class Unit { kValue, kLength, kRadians } unit = Unit::kValue;
  // Range of valid values, inclusive; equal to the range that the scene reader accepts.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
};

}  // namespace limn
