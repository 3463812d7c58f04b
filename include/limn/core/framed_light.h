#pragma once
// A delta light whose irradiance ends discontinuously at a rectangular frame, whose sides are
// planes through the light.
#include <array>

#include "limn/core/light.h"
#include "limn/core/var.h"

namespace limn {

class FramedLight : public DeltaLight {
 public:
  // From the light to the corners of its frame, at the distance 1 along its axis: in order around
  // it, a rectangle.
  virtual std::array<Vec3<Dual>, 4> corners() const = 0;
};

// One of them, as leaves of the current tape.
Vec3<Var> corner_of_frame(const FramedLight& light, size_t corner);

}  // namespace limn
