#pragma once
// Colours, numbers and values of BSDFs (bsdf.h).
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

}  // namespace limn
