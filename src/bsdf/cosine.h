#pragma once
// Directions with the density cos / pi.
#include "src/base/angles.h"

namespace limn {

// A uniform point of the unit disk, lifted to the hemisphere about n (Malley's method): of height
// sqrt(1 - u1). S: double, or wide::Doubles.
template <class S>
Vec3<S> sample_cosine(const Vec3<S>& n, const S& u1, const S& u2) {
  using std::sqrt;
  const S r = sqrt(u1);
  const SinCosOf<S> phi = sin_cos_of_turns(u2);
  return FrameOf<S>(n).to_world({r * phi.cos, r * phi.sin, sqrt(1.0 - u1)});
}

}  // namespace limn
