#pragma once
// The path tracer's smooth rays, and what passes surfaces. Included by path_follow.h.
#include <limits>
#include <optional>

#include "integrators/paths/path.h"
#include "integrators/paths/path_directions.h"
#include "integrators/paths/straight_way.h"

namespace limn {

// Chooses a smooth ray (true) or the rough lobes (false); the third number is then rescaled to
// [0, 1).
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::turns_smoothly(Walk& walk) const {
  if (!walk.scattering->is_smooth()) return false;
  const SmoothShares shares = walk.scattering->shares();
  const std::optional<int> k = detail::choose_smooth(shares, walk.u[2]);
  if (!k) return false;
  walk.smooth_ray = *k;
  walk.smooth_share = shares.ray[*k];
  return true;
}

// Whether the edges that the smooth ray wo sees are in no term: the path has come otherwise than
// straight on, by a chain of flat mirrors or, from the camera, through flat glass.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::hides_edges(Walk& walk, const Vec3d& wo) const {
  if (walk.step.pdf > 0) {
    walk.chain = {};
    walk.was_rough = true;
  }
  if (goes_straight(value(walk.wi), wo)) return false;
  const FlatMirrors* const mirrors = c_.flat_mirrors;
  // Shadows of delta lights are seen straight on alone.
  if (!mirrors || !c_.scene.delta_lights.empty()) return true;
  FlatMirrors::Chain& chain = walk.chain;
  const bool through = walk.scattering->passes(wo);
  const uint32_t mirror = mirrors->of(walk.surface.face);
  if (mirror == FlatMirrors::kNone || chain.count == FlatMirrors::kLongest) return true;
  if (chain.count > 0 && through != chain.through) return true;
  chain.mirrors[chain.count++] = mirror;
  chain.through = through;
  const Vec3d n = walk.scattering->front() ? walk.surface.n_g : -walk.surface.n_g;
  // The camera sees all of them but by way of a refracting plane that cuts its lens; vertices see
  // nothing refracted.
  const auto cuts_lens = [&] {
    const Camera& camera = c_.scene.camera;
    const double across = length(cross(n, value(camera.forward)));
    return std::fabs(dot(n, value(walk.surface.p) - value(camera.origin))) <
           camera.aperture_radius.v * across;
  };
  return (through && (walk.was_rough || cuts_lens())) ||
         (!through && !is_mirrored(n, value(walk.wi), wo)) || !mirrors->has(chain);
}

// Along the smooth ray that was chosen; false where the path ends. Its direction moves with the
// vertex, and what holds directions of rough lobes does not hold this one.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::turn_smoothly(Walk& walk) const {
  const SmoothRay<S> ray = smooth_ray(walk);
  if (!(walk.smooth_share > 0) || detail::stays_black(ray.weight)) return false;
  if (!walk.turned_by.valid() && hides_edges(walk, value(ray.wo))) {
    walk.turned_by = walk.surface.face.shape;
    walk.before_turn = value(walk.sums.radiance);
  }
  walk.motion = nullptr;
  walk.direction = detail::in_scalar<Place>(ray.wo);
  walk.wo = value(ray.wo);
  walk.pdf = std::numeric_limits<double>::infinity();
  walk.throughput = walk.throughput * ray.weight * (1 / walk.smooth_share);
  if (goes_straight(value(walk.wi), walk.wo)) {
    leave_straight(walk);
  } else if (walk.scattering->passes(walk.wo)) {
    leave_surface(walk, ray.eta);
  }
  return goes_on(walk, 0);
}

// Moves those of `count` walks that take smooth rays and go on into `turned`, and returns their
// number. The others stay, and are counted.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::turn_smoothly(Walk** walks, size_t& count,
                                                    Walk** turned) const {
  size_t kept = 0, turns = 0;
  for (size_t i = 0; i < count; ++i) {
    Walk* const walk = walks[i];
    if (turns_smoothly(*walk)) {
      turned[turns] = walk;
      turns += guarded(*walk, [&] { return turn_smoothly(*walk); });
    } else {
      walks[kept++] = walk;
    }
  }
  count = kept;
  return turns;
}

// On from the face itself: a ray that goes straight on is not lifted.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::leave_straight(Walk& walk) const {
  if (!is_lifted(c_.scene, walk.surface.face.shape)) return;
  const auto& x = walk.surface.on_face;
  walk.surface.p = {x[0], x[1], x[2]};
  walk.surface.lifted = false;
}

// To the other side of the surface. eta: the index of refraction there over that on this side.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::leave_surface(Walk& walk, double eta) const {
  walk.eta *= eta;
  walk.surface = beyond(c_.scene, walk.surface, walk.wi);
  if (walk.two_sided) walk.lights = c_.lights.at(value(walk.surface.p));
}

}  // namespace limn
