#pragma once
// Smooth (delta) lobes of BSDFs: what they see is a ray each, a function of the viewer's direction.
#include <array>

#include "limn/core/vec.h"

namespace limn {

class Bsdf;

// What a smooth lobe sees: radiance that arrives from wo counts times the weight, without a cosine
// or a density.
template <class S>
struct SmoothRay {
  Vec3<S> wo;  // unit; n.wo < 0 behind the surface
  Rgb<S> weight;
  double eta = 1;  // the index of refraction where wo lies over that where wi lies
  // Nothing passes, nor begins to as a parameter moves: total reflection. The weight is 0.
  bool total = false;
};
// At most so many of one BSDF.
inline constexpr int kMostSmoothRays = 4;
template <class S>
using SmoothRays = std::array<SmoothRay<S>, kMostSmoothRays>;

// With which probabilities a path takes the smooth rays of a BSDF, or its rough lobes.
struct SmoothShares {
  enum class By {
    kWeight,  // in proportion to what they scatter
    kSlope,   // also what scatters little: its derivative need not be small
    kSteps,   // in a few steps, so that a small step of a parameter seldom changes them
  };
  int count = 0;  // of rays
  std::array<double, kMostSmoothRays> ray{};
  double rough = 1;
};
// Arguments as of Bsdf::eval.
SmoothShares smooth_shares(const Bsdf& bsdf, const Vec3d& n, const Vec3d& wi, const Rgb<double>* at,
                           SmoothShares::By by);

}  // namespace limn
