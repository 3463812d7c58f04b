#pragma once
// A differentiable value of an object of the scene.
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "limn/core/dual.h"

namespace limn {

// A differentiable value of an object: "alpha", "reflectance", "radiance", ... A colour is
// differentiated along grey: all channels change by the same amount. Channels do not
// mix unless it says so: channel c of the derivative image is that with respect to channel c.
struct ParameterRef {
  std::string name;
  std::vector<Dual*> values;  // one, or the three channels
  enum class Unit { kValue, kLength, kRadians } unit = Unit::kValue;
  // Range of valid values, inclusive; equal to the range that the scene reader accepts.
  double least = -std::numeric_limits<double>::infinity();
  double most = std::numeric_limits<double>::infinity();
  // True if a channel of a colour acts on all channels of what is scattered.
  bool mixes_channels = false;
  // To be called after the values have changed, if there is something to update.
  std::function<void()> changed = {};
};

}  // namespace limn
