#pragma once
// The path tracer's light sampling: what a light that was drawn adds. Included by path_follow.h.
#include "integrators/edges/viewpoint.h"
#include "integrators/paths/path.h"
#include "integrators/paths/path_colours.h"
#include "integrators/paths/path_directions.h"

namespace limn {

// Sets the factor on the drawn light's radiance; drops the sample where its f_s is zero.
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
