#pragma once
// Radiance and scattering of paths whose vertices do not move (Unmoved): positions and directions
// are plain numbers, colours carry derivatives. Included by path_follow.h.
#include <type_traits>

#include "integrators/paths/path.h"
#include "integrators/paths/path_directions.h"

namespace limn {

namespace detail {

// A vector as S: its derivatives are dropped where S is double, and zero where it has none.
template <class S, class Place>
inline Vec3<S> in_scalar(const Vec3<Place>& v) {
  if constexpr (std::is_same_v<S, double>) {
    return value(v);
  } else {
    return {v.x, v.y, v.z};
  }
}
template <class S>
inline Rgb<S> in_scalar(const Rgb<double>& c) {
  return {c.r, c.g, c.b};
}
template <class S, class Place>
inline Rgb<S> emission(const SurfacePoint<Place>& surface, const Vec3d& wi, ShadingModel model) {
  if constexpr (std::is_same_v<S, Place>) {
    return surface.emission(wi, model);
  } else {
    if (!surface.shape->is_emitter) return {};
    return as_dual(surface).emission(wi, model);
  }
}

}  // namespace detail

// Sets the vertex's scattering with derivatives, where its BSDF has any.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::colour(Walk& walk) const {
  if constexpr (kColoursAlone<S, Visitor>) {
    walk.coloured.reset();
    if (!colours_->of(walk.surface.face.shape, walk.scattering->front())) return;
    walk.coloured.emplace(detail::as_dual(walk.surface), detail::in_scalar<S>(walk.wi),
                          c_.scene.shading);
  }
}

// evaluation: of walk.scattering at wo.
template <class S, class Visitor>
inline auto PathTracer<S, Visitor>::coloured(
    const Walk& walk, const typename Scattering<Place>::Evaluation& evaluation,
    const Vec3d& wo) const -> Evaluation {
  if constexpr (kColoursAlone<S, Visitor>) {
    if (walk.coloured) return {walk.coloured->eval(wo), evaluation.pdf};
    return {detail::in_scalar<S>(evaluation.value), evaluation.pdf};
  } else {
    return evaluation;
  }
}

// direction: wo as it moves.
template <class S, class Visitor>
inline auto PathTracer<S, Visitor>::evaluate(const Walk& walk, const Vec3d& wo,
                                             const DirectionMotion* motion,
                                             const Vec3<Place>& direction) const -> Evaluation {
  return coloured(walk, detail::evaluate(*walk.scattering, wo, direction, motion), wo);
}

// The BSDF times cosine towards wo, which may move.
template <class S, class Visitor>
template <class W>
inline Rgb<S> PathTracer<S, Visitor>::scattered_into(const Walk& walk, const Vec3<W>& wo) const {
  if constexpr (kColoursAlone<S, Visitor>) {
    if (walk.coloured) return walk.coloured->eval(wo);
    return detail::in_scalar<S>(walk.scattering->eval(value(wo)));
  } else {
    return walk.scattering->eval(wo);
  }
}

// The environment's radiance along the path's direction, with its density [1/sr].
template <class S, class Visitor>
inline auto PathTracer<S, Visitor>::sight(const Walk& walk) const -> Environment::Sight<S> {
  if constexpr (kColoursAlone<S, Visitor>) {
    if (!colours_->of_sky()) {
      const auto seen = c_.lights.template environment<double>(walk.lights, walk.wo, walk.sky);
      return {detail::in_scalar<S>(seen.radiance), seen.pdf};
    }
  }
  return c_.lights.template environment<S>(walk.lights, walk.wo, walk.sky);
}

// The radiance that arrives from the drawn direction of a light that is no face.
template <class S, class Visitor>
inline Rgb<S> PathTracer<S, Visitor>::drawn_radiance(const LightSample& light) const {
  if constexpr (kColoursAlone<S, Visitor>) {
    if (!light.face && !colours_->of_sky()) {
      return detail::in_scalar<S>(light.light->template drawn_radiance<double>(light));
    }
  }
  return light.light->template drawn_radiance<S>(light);
}

template <class S, class Visitor>
inline SmoothRay<S> PathTracer<S, Visitor>::smooth_ray(const Walk& walk) const {
  if constexpr (kColoursAlone<S, Visitor>) {
    if (walk.coloured) return walk.coloured->smooth_ray(walk.smooth_ray);
    const SmoothRay<double> ray = walk.scattering->smooth_ray(walk.smooth_ray);
    return {detail::in_scalar<S>(ray.wo), detail::in_scalar<S>(ray.weight), ray.eta, ray.total};
  } else {
    return walk.scattering->smooth_ray(walk.smooth_ray);
  }
}

}  // namespace limn
