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
  size_t seen = 0;
  for (size_t i = 0; i < count; ++i) {
    Walk* const walk = lit[i];
    lit[seen] = walk;
    seen += guarded(*walk, [&] { return !shadowed(*walk); });
  }
  for (size_t i = 0; i < seen; ++i) add_light(*lit[i]);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::add_light(Walk& walk) const {
  walk.sums.radiance += walk.throughput * light_value(walk);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::add_lights(Walk& walk, int count) {
  const Rgb<S> share = walk.throughput * (1.0 / count);
  PathSums<S>& sums = walk.sums;
  for (int i = 0; i < count; ++i) {
    const Rng copy = walk.key.copy(Purpose::kLightCopy, i);
    const Rgb<S> light = share * direct_light(walk, copy);
    sums.radiance += light;
    if (walk.bounces == 0) continue;
    sums.light_difference =
        i % 2 == 0 ? sums.light_difference + light : sums.light_difference - light;
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

// What the light that was drawn adds but for its radiance; none if that is black.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::weigh_light(Walk& walk) const {
  if (!walk.light) return;
  const LightSample& light = *walk.light;
  if (const DeltaLight* delta = light.light->delta()) {
    draw_delta(walk, *delta);
    return;
  }
  walk.light_motion = light.face ? nullptr : walk.motion;  // an emitter: held
  const Vec3<Place> direction = detail::moving<Place>(light.wo, walk.light_motion);
  const Evaluation evaluation = evaluate(walk, light.wo, walk.light_motion, direction);
  if (!weigh_light(walk, evaluation)) walk.light.reset();
}

// evaluation: at the light's direction as it moves. False if nothing comes of it.
template <class S, class Visitor>
[[gnu::always_inline]] inline bool PathTracer<S, Visitor>::weigh_light(
    Walk& walk, const Evaluation& evaluation) const {
  const LightSample& light = *walk.light;
  const auto& [f, pdf] = evaluation;
  walk.light_share = detail::stretched(f, light.wo, walk.light_motion);
  walk.light_weight = mis_weight_over_pdf(light.pdf, density(walk, light.wo, pdf));
  return !detail::stays_black(f);
}

// No ray meets a delta light by chance, so it has the whole weight. Its direction follows the
// parameters, and f_s with it. A face that it sees edge-on stays as dark as it is, as its edges
// have it: rounding would tell which half of the face begins to be lit as the scene moves.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::draw_delta(Walk& walk, const DeltaLight& delta) const {
  const bool passes = walk.two_sided && walk.beyond;
  const Vec3<Place> p = passes ? beyond(c_.scene, walk.surface, walk.wi).p : walk.surface.p;
  const auto arriving = limn::arrival<S>(delta, detail::in_scalar<S>(p));
  if (arriving) {
    const Rgb<S> f = scattered_into(walk, arriving->wo);
    walk.light_share = f * arriving->irradiance * (1 / walk.light->pdf);
    if constexpr (!std::is_same_v<S, double>) {
      if (std::fabs(dot(walk.surface.n_g, value(arriving->wo))) <= kEdgeOn) {
        const Rgb<double> held = value(walk.light_share);
        walk.light_share = {S(held.r), S(held.g), S(held.b)};
      }
    }
    if (!detail::stays_black(f)) return;
  }
  walk.light.reset();
}

template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::light_value(const Walk& walk) const {
  const LightSample& light = *walk.light;
  if (light.light->delta()) return walk.light_share;
  if constexpr (std::is_same_v<Place, Dual>) {
    if (const DirectionMotion* motion = walk.light_motion) {
      return walk.light_share * light.light->radiance(detail::moving<S>(light.wo, motion)) *
             walk.light_weight;
    }
  }
  return walk.light_share * emitted(walk, nullptr) * walk.light_weight;
}

// Radiance of the light that was drawn. motion: of its direction, where that is an emitter's.
template <class S, class Visitor>
[[gnu::always_inline]] inline Rgb<S> PathTracer<S, Visitor>::emitted(
    const Walk& walk, const DirectionMotion* motion) const {
  const LightSample& light = *walk.light;
  if (light.face && c_.scene.shape(light.face->shape).radiance_texture) {
    const bool passes = walk.two_sided && walk.beyond;
    const Vec3<Place> p = passes ? beyond(c_.scene, walk.surface, walk.wi).p : walk.surface.p;
    const auto at =
        surface_on_ray<Place>(c_.scene, *light.face, p, detail::moving<Place>(light.wo, motion));
    return detail::emission<S>(at, -light.wo, c_.scene.shading);
  }
  return drawn_radiance(light);
}

// What a light adds where directions are warped: auxiliary rays are traced for light that
// arrives.
template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::warped_light(const Walk& walk, const Rng& key) {
  const LightSample& light = *walk.light;
  const SurfacePoint<Place>& surface = walk.surface;
  const Scattering<Place>& scattering = *walk.scattering;
  if (detail::stays_black(scattering.eval(light.wo))) return {};
  if (shadowed(walk)) return {};
  const DirectionMotion* motion = warper_->motion(surface, light.wo, key.at(Purpose::kEmitter, 1));
  const Vec3<Place> direction = detail::moving<Place>(light.wo, motion);
  const auto [f, bsdf_pdf] = detail::evaluate(scattering, light.wo, direction, motion);
  const double weight = mis_weight_over_pdf(light.pdf, density(walk, light.wo, bsdf_pdf));
  const Rgb<S> radiance =
      motion && !light.face ? light.light->radiance(direction) : emitted(walk, motion);
  return detail::stretched(f, light.wo, motion) * radiance * weight;
}

}  // namespace limn
