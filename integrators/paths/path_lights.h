#pragma once
// The path tracer's light sampling: one light drawn at a vertex, weighed against the direction that
// the surface would have sampled. Included by path_follow.h.
#include "integrators/edges/viewpoint.h"
#include "integrators/paths/path.h"
#include "integrators/paths/path_directions.h"

namespace limn {

// Chooses the side of a surface that light passes for which lights are drawn, where the sides have
// starting points of their own. Both ways to find a light count with the density of the same way to
// draw it.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::choose_side(Walk& walk) const {
  walk.two_sided =
      walk.scattering->bsdf().lobes().below && is_lifted(c_.scene, walk.surface.face.shape);
  if (!walk.two_sided) return;
  Rng rng = walk.key.at(Purpose::kEmitter, walk.bounces).at(Purpose::kEmitter, 2);
  walk.beyond = rng.uniform() < 0.5;
  if (walk.beyond) {
    walk.lights = c_.lights.at(beyond(c_.scene, value(walk.surface), value(walk.wi)).p);
  }
}

// Leaves a light that was drawn only if it is on the side that was chosen.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::keep_side(Walk& walk) const {
  if (!walk.two_sided || !walk.light) return;
  if (walk.scattering->passes(walk.light->wo) == walk.beyond) {
    walk.light->pdf *= 0.5;
  } else {
    walk.light.reset();
  }
}

// One light for each, if there is any, where there have been no others.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::draw_lights(std::span<Walk* const> walks) const {
  static_assert(kMostWalks <= Lights::kMostDraws);
  if (c_.lights.empty()) return;
  Rng::Stream streams[kMostWalks];
  Lights::Draw draws[kMostWalks];
  size_t count = 0;
  for (Walk* const walk : walks) {
    if (walk->lit) continue;
    streams[count] = {&walk->key, static_cast<uint64_t>(walk->bounces)};
    draws[count++] = {&walk->lights, &walk->light};
  }
  Lights::Numbers u[kMostWalks];
  Rng::draw(Purpose::kEmitter, {streams, count}, u);
  c_.lights.sample({draws, count}, {u, count});
  for (Walk* const walk : walks) {
    if (!walk->lit) keep_side(*walk);
  }
}

// Adds what the lights that have been drawn send.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::shine(std::span<Walk* const> walks) {
  Walk* lit[kMostWalks];
  const size_t count = weigh_lights(walks, lit);
  const size_t seen = find_unshadowed({lit, count});
  for (size_t i = 0; i < seen; ++i) add_light(*lit[i]);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::add_light(Walk& walk) const {
  walk.sums.radiance += walk.throughput * light_value(walk);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::add_lights(Walk& walk, int count) {
  const Rgb<S> share = walk.throughput * (1.0 / count);
  for (int i = 0; i < count; ++i) {
    const Rng copy = walk.key.copy(Purpose::kLightCopy, i);
    walk.sums.radiance += share * direct_light(walk, copy);
  }
  walk.light.reset();
}

template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::direct_light(Walk& walk, const Rng& key) {
  draw_light(walk, key);
  if constexpr (std::is_same_v<Place, Dual>) {
    if (warper_ && walk.light && !walk.light->light->delta()) {
      return warped_light(walk, key.at(Purpose::kEmitter, walk.bounces));
    }
  }
  weigh_light(walk);
  return !walk.light || shadowed(walk) ? Rgb<S>{} : light_value(walk);
}

// Draws a light, if there is any.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::draw_light(Walk& walk, const Rng& key) const {
  walk.light.reset();
  if (c_.lights.empty()) return;
  Rng rng = key.at(Purpose::kEmitter, walk.bounces);
  renew(walk.light, [&] { return c_.lights.sample(walk.lights, rng); });
  keep_side(walk);
}

// How many get light, if nothing hides it: they are put into `lit`.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::weigh_lights(std::span<Walk* const> walks, Walk** lit) const {
  if constexpr (kPlain) {
    if (scatters_wide_) return weigh_lights_wide(walks, lit);
  }
  size_t count = 0;
  for (Walk* const walk : walks) {
    weigh_light(*walk);
    lit[count] = walk;
    count += walk->light.has_value();
  }
  return count;
}

}  // namespace limn
