#pragma once
// The path tracer where a ray ends: what the sky and surfaces emit there, roulette. Included by
// path_follow.h.
#include <algorithm>
#include <cmath>

#include "integrators/paths/path.h"
#include "integrators/paths/path_colours.h"
#include "integrators/paths/path_directions.h"

namespace limn {

// Adds what rays see that leave the scene; there their paths end.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::escape(std::span<Walk* const> walks) const {
  if (!c_.scene.environment) return;
  find_sky(walks);
  for (Walk* const walk : walks) escape(*walk);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::escape(Walk& walk) const {
  const auto sky = [&] {
    return environment_radiance<S>(*c_.scene.environment, detail::in_scalar<S>(walk.direction));
  };
  if (std::isinf(walk.pdf)) {
    walk.sums.radiance += walk.throughput * sky();
    return;
  }
  Environment::Sight<S> seen = sight(walk);
  if (walk.motion) seen.radiance = sky();
  const double other = light_pdf(walk, seen.pdf);
  walk.sums.radiance += walk.throughput * seen.radiance * mis_weight(walk.pdf, other);
}

// Goes on to what the ray meets.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::arrive(Walk& walk) {
  const DirectionMotion* motion = walk.motion;
  Rgb<S>& radiance = walk.sums.radiance;
  const FaceRef face = walk.hit.face;
  if (walk.last && !(c_.lights.on_shapes() && c_.scene.shape(face.shape).is_emitter)) {
    return false;
  }
  if (walk.hit.t > 0) {
    const Vec3<Place> from = walk.surface.p;
    renew(walk.surface,
          [&] { return surface_on_ray<Place>(c_.scene, face, from, walk.direction); });
    walk.edge = nullptr;
    walk.beside_edge = false;
  } else {
    move_along_edge(walk.surface, face, walk.wo);
  }
  walk.wi = -walk.direction;
  const Rgb<S> emitter = emitted(walk);
  if (motion && !motion->warp && !is_black(value(emitter))) {
    radiance += walk.before * walk.scattering->eval(walk.wo) * emitter * (1 / walk.pdf);  // held
  } else {
    radiance += walk.throughput * emitter;
  }
  ++walk.bounces;
  return survives_roulette(walk);
}

template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::emitted(const Walk& walk) const {
  const SurfacePoint<Place>& surface = walk.surface;
  const double distance = walk.hit.t;
  const Rgb<S> radiance = detail::emission<S>(surface, -walk.wo, c_.scene.shading);
  if (detail::stays_black(radiance)) return radiance;
  // A face around an edge that is met at distance 0 is never drawn by light sampling.
  if (std::isinf(walk.pdf)) return radiance;
  const LightView view{walk.wo, distance, surface.n_g, surface.face.face};
  const double other = distance > 0 ? c_.lights.pdf(walk.lights, surface.face.shape, view) : 0;
  return radiance * mis_weight(walk.pdf, light_pdf(walk, other));
}

// A surface that is black before it moves need not be afterwards.
template <class S, class Visitor>
inline double PathTracer<S, Visitor>::unmoved_albedo(const Walk& walk) const {
  constexpr double kLeast = 0.1;  // not tuned
  const Shape& shape = c_.unmoved->shape(walk.surface.face.shape);
  const Bsdf* bsdf = shape.bsdf->side(walk.scattering->front());
  return std::clamp(bsdf->lobe().albedo, kLeast, 1.0);
}

// As in Mitsuba: from rr_depth bounces on, survival with the largest throughput, at most 0.95,
// without what refraction scales it by.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::survives_roulette(Walk& walk) const {
  if (walk.bounces < c_.scene.rr_depth) return true;
  constexpr double kBlack = 0.5;  // of a path that is not bright yet; not tuned
  const double throughput = max_channel(value(walk.throughput)) * (walk.eta * walk.eta);
  const double largest = c_.unmoved ? walk.albedo : throughput != 0 ? throughput : kBlack;
  const double survival = std::min(largest, 0.95);
  Rng rng = walk.key.at(Purpose::kRoulette, walk.bounces);
  if (rng.uniform() >= survival) return false;
  walk.throughput = walk.throughput * (1 / survival);
  walk.albedo /= survival;
  return true;
}

}  // namespace limn
