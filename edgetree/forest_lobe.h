#pragma once
// Roughly the mean of a scattering function over the directions of four boxes: importance only.
#include "limn/core/bsdf.h"
#include "simd4.h"

namespace limn {

class ForestLobe {
 public:
  // n: unit; wi: unit, n.wi > 0
  ForestLobe(const Vec3d& n, const Vec3d& wi, const LobeSummary& lobe)
      : diffuse_(lobe.kind == LobeSummary::Kind::kDiffuse) {
    const Vec3d axis = n * (2 * limn::dot(n, wi)) - wi;
    for (int k = 0; k < 3; ++k) {
      n_[k] = static_cast<float>(n[k]);
      axis_[k] = static_cast<float>(axis[k]);
    }
    alpha2_ = static_cast<float>(lobe.alpha * lobe.alpha);
  }

  // d: centres of boxes minus p; distance: their lengths; radius: of the spheres around the boxes.
  // Any unit of length. Positive.
  Float4 mean(const Float4x3& d, Float4 distance, Float4 radius) const {
    const Float4 inverse = 1 / distance;
    const Float4 spread = min(radius * inverse, splat(1.0f));
    const Float4 cosine = dot(d, n_) * inverse;
    const Float4 horizon = clamped_cosine(cosine, spread);
    if (diffuse_) return horizon;
    // A GGX lobe around the mirror direction, as wide as the lobe and the box together.
    const Float4 cos2 = clamp(0.5f + 0.5f * dot(d, axis_) * inverse, splat(0.0f), splat(1.0f));
    const Float4 a2 = min(alpha2_ + 0.25f * spread * spread, splat(1.0f));
    const Float4 k = cos2 * a2 + (1 - cos2);
    return horizon * a2 / (k * k);
  }

 private:
  static Float4 dot(const Float4x3& d, const float (&v)[3]) {
    return d.x * v[0] + d.y * v[1] + d.z * v[2];
  }
  // Mean of max(0, cosine + x) over x in [-spread, spread], at least a little.
  static Float4 clamped_cosine(Float4 cosine, Float4 spread) {
    const Float4 above = max(cosine + spread, splat(0.0f));
    const Float4 partly = above * above / (4 * spread + 1e-20f);
    return max(select(cosine > spread, cosine, partly), 1e-3f * spread + 1e-6f);
  }

  bool diffuse_;
  float n_[3], axis_[3];
  float alpha2_;
};

}  // namespace limn
