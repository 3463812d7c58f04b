#pragma once
// Colours, numbers and values of BSDFs (bsdf.h).
#include <array>

#include "limn/core/dual.h"
#include "limn/core/vec.h"

namespace limn {

// At most so many textures of one BSDF.
inline constexpr int kMostTextures = 12;

// A colour of a BSDF. The BSDF asks for its value and does not know whether that is a constant,
// which derivatives take, or a texture's.
struct BsdfColour {
  Rgb<Dual> constant;  // of a texture: its mean
  double most = 1;     // of a texture: its largest value
  int texture = -1;    // where its value stands in `at`; -1: it is constant

  // at: see Bsdf; null: the mean.
  template <class S>
  Rgb<S> of(const Rgb<S>* at) const {
    return at && texture >= 0 ? at[texture] : as<S>(constant);
  }
  // Upper bound of its channels.
  double bound(const Rgb<double>* at = nullptr) const {
    return texture >= 0 && !at ? most : max_channel(of<double>(at));
  }
};

// A number of a BSDF (a roughness), constant or from a texture, as BsdfColour is for colours.
struct BsdfNumber {
  Dual constant;
  int texture = -1;

  template <class S>
  S of(const Rgb<S>* at) const {
    return at && texture >= 0 ? at[texture].r : as<S>(constant);
  }
};

// The value of a BSDF and the density of `sample` for one pair of directions.
struct BsdfValue {
  Rgb<double> value;
  double pdf = 0;  // [1/sr]
};

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
