#pragma once
// What moves with a direction that a path samples: the scattering function, the solid angle around
// it, the score of its density. motion: null where directions are held.
#include <optional>
#include <type_traits>

#include "integrators/paths/direction_field.h"
#include "integrators/paths/warp_field.h"
#include "limn/core/shading.h"

namespace limn::detail {

// The smooth ray that u in [0, 1) chooses; none: the rough lobes, and u becomes uniform again.
inline std::optional<int> choose_smooth(const SmoothShares& shares, double& u) {
  if (u < shares.rough) {
    u /= shares.rough;
    return {};
  }
  double left = u - shares.rough;
  int k = 0;
  while (k + 1 < shares.count && left >= shares.ray[k]) left -= shares.ray[k++];
  return k;
}

// Whether nothing comes of it: what is black now, as a black surface's light is, may still begin to
// shine as a parameter grows.
template <class S>
inline bool stays_black(const Rgb<S>& c) {
  if constexpr (std::is_same_v<S, double>) {
    return is_black(c);
  } else {
    return is_black(value(c)) && is_constant(c);
  }
}

// w as it moves.
template <class S>
inline Vec3<S> moving(const Vec3d& w, const DirectionMotion* motion) {
  if constexpr (std::is_same_v<S, Dual>) {
    if (motion) return motion->warp ? warped(w, *motion->warp) : turning(w, motion->turn);
  }
  return {w.x, w.y, w.z};
}

// direction: w as it moves. The density is that of w [1/sr].
template <class S>
inline typename Scattering<S>::Evaluation evaluate(const Scattering<S>& scattering, const Vec3d& w,
                                                   const Vec3<S>& direction,
                                                   const DirectionMotion* motion) {
  if (!motion) return scattering.eval_with_pdf(w);
  return {scattering.eval(direction), scattering.pdf_solid_angle(w)};
}

// f times the change of a solid angle around w.
template <class S>
inline Rgb<S> stretched(const Rgb<S>& f, const Vec3d& w, const DirectionMotion* motion) {
  if constexpr (std::is_same_v<S, Dual>) {
    if (motion && motion->warp) return f * Dual(1.0, motion->warp->divergence);
    if (motion && motion->turn.follows()) return f * Dual(1.0, divergence(w, motion->turn));
  }
  return f;
}

// Adds what the score of a walk's next direction is worth with this weight.
template <class S, class Walk>
inline void add_score(Walk& walk, const Rgb<double>& weight) {
  if constexpr (std::is_same_v<S, Dual>) {
    const DirectionMotion* motion = walk.motion;
    if (!motion || !motion->scoring) return;
    Rgb<Lanes> f = walk.scattering->eval_derivative(turning(walk.wo, motion->score));
    if (motion->score.follows()) {
      const Rgb<double> still = value(walk.scattering->eval(walk.wo));
      const Lanes stretch = divergence(walk.wo, motion->score);
      for (int c = 0; c < 3; ++c) f[c] += stretch * still[c];
    }
    walk.sums.score = walk.sums.score + Rgb<Lanes>{f.r * weight.r, f.g * weight.g, f.b * weight.b};
  }
}

}  // namespace limn::detail
