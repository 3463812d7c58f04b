#pragma once
// The path tracer at a vertex: what is scattered there, and the next direction. Included by
// path_follow.h.
#include <algorithm>

#include "integrators/paths/path.h"
#include "integrators/paths/path_directions.h"

namespace limn {

// What comes first at a vertex, and lights where they are many; false where the path ends.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::begin_vertex(Walk& walk) {
  if (is_complete(walk.bounces)) return false;
  walk.scattering.emplace(walk.surface, walk.wi, c_.scene.shading);
  if (walk.scattering->black()) return false;
  constexpr bool kColours = kColoursAlone<S, Visitor>;
  if ((c_.unmoved || kColours) && walk.scattering->is_smooth()) {
    using By = SmoothShares::By;
    walk.scattering->share_by(c_.unmoved ? By::kSteps : By::kSlope);
  }
  if constexpr (kColours) colour(walk);
  set_motion(walk);
  walk.light.reset();
  walk.lit = walk.again;
  if (walk.again) {
    walk.again = false;
    return true;
  }
  // Edges behind a black surface show nothing, also if it begins to shine.
  if (walk.visitor && !is_black(value(walk.throughput))) {
    (*walk.visitor)(walk.surface, *walk.scattering, walk.throughput, walk.motion, walk.step,
                    walk.bounces, walk.key);
  }
  if (c_.closed) {
    if constexpr (!kColoursAlone<S, Visitor>) {
      walk.sums.radiance +=
          c_.closed->scattered(c_.tracer, walk.surface, *walk.scattering, walk.start_edge());
    }
    return false;
  }
  if (!walk.scattering->is_rough()) {
    walk.lit = true;
    walk.two_sided = false;
    walk.mixture.share = 0;
    return true;
  }
  // Copies have both from the path that they are of.
  if (!wide_) renew(walk.lights, [&] { return c_.lights.at(value(walk.surface.p)); });
  choose_side(walk);
  if (c_.mirrored) {
    renew(walk.mixture, [&] {
      return mixture_at(c_.mirrored, walk.surface, *walk.scattering,
                        !is_complete(walk.bounces + 1));
    });
  }
  const int more = splits(walk.surface, walk.copies);
  walk.lit = more > 1 || warper_;
  if (walk.lit) add_lights(walk, more);
  if (more > 1) split(walk, more);
  return true;
}

// Draws what the next directions are drawn from; the third number only where there is a choice.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::draw_numbers(std::span<Walk* const> walks) const {
  Rng::Stream streams[kMostWalks];
  bool mixed = false;
  for (size_t i = 0; i < walks.size(); ++i) {
    streams[i] = {&walks[i]->key, static_cast<uint64_t>(walks[i]->bounces)};
    mixed |= walks[i]->mixture.share != 0 || walks[i]->scattering->is_smooth();
  }
  const auto draw = [&]<size_t kCount>(std::integral_constant<size_t, kCount>) {
    std::array<double, kCount> u[kMostWalks];
    Rng::draw(Purpose::kBsdf, {streams, walks.size()}, u);
    for (size_t i = 0; i < walks.size(); ++i) {
      std::copy(u[i].begin(), u[i].end(), walks[i]->u.begin());
    }
  };
  if (mixed) {
    draw(std::integral_constant<size_t, 3>());
  } else {
    draw(std::integral_constant<size_t, 2>());
  }
}

// After a path has been given its next direction, of this density (see PathStep).
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::goes_on(Walk& walk, double pdf) const {
  walk.step = {value(walk.surface.p), pdf, walk.surface.face, walk.step.from};
  walk.last = is_complete(walk.bounces + 1);
  return !walk.last || c_.lights.on_shapes() || c_.scene.environment;
}

// Draws the next direction towards what is mirrored, if its turn has come.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::draw_mirrored(Walk& walk) const {
  const auto& u = walk.u;
  if (walk.mixture.share == 0 || !(u[2] < walk.mixture.share)) return false;
  const auto wo = MirroredLight::sample(walk.mixture, u[2] / walk.mixture.share, u[0], u[1]);
  walk.wo = wo.value_or(Vec3d{});
  return true;
}

// Draws the next direction.
template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::choose_direction(Walk& walk) {
  if (!draw_mirrored(walk)) {
    walk.wo = walk.scattering->sample(walk.u[0], walk.u[1]).value_or(Vec3d{});
  }
  if (walk.wo == Vec3d{}) return false;
  if constexpr (std::is_same_v<Place, Dual>) {
    if (warper_) {
      const Rng key = walk.key.at(Purpose::kBsdf, walk.bounces).at(Purpose::kBsdf, 1);
      walk.motion = warper_->motion(walk.surface, walk.wo, key);
    }
  }
  return true;
}

template <class S, class Visitor>
inline bool PathTracer<S, Visitor>::scatter(Walk& walk) {
  walk.direction = detail::moving<Place>(walk.wo, walk.motion);
  return scatter(walk, evaluate(walk, walk.wo, walk.motion, walk.direction));
}

// evaluation: at walk.direction, which is walk.wo as it moves.
template <class S, class Visitor>
[[gnu::always_inline]] inline bool PathTracer<S, Visitor>::scatter(Walk& walk,
                                                                   const Evaluation& evaluation) {
  const auto& [f, scattered] = evaluation;
  if (detail::stays_black(f)) return false;
  const double pdf = density(walk, walk.wo, scattered);
  walk.pdf = pdf;
  detail::add_score<Place>(walk, value(walk.throughput) * (1 / pdf));
  walk.before = walk.throughput;
  walk.throughput = walk.throughput * detail::stretched(f, walk.wo, walk.motion) * (1 / pdf);
  if (c_.unmoved) walk.albedo *= unmoved_albedo(walk);
  if (walk.scattering->passes(walk.wo)) {
    leave_surface(walk, walk.scattering->bsdf().eta(walk.scattering->at()));
  } else if (walk.two_sided && walk.beyond) {
    walk.lights = c_.lights.at(value(walk.surface.p));
  }
  return goes_on(walk, pdf);
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::set_motion(Walk& walk) const {
  walk.motion = nullptr;
  if constexpr (std::is_same_v<Place, Dual>) {
    if (walk.bounces > 0 || !walk.field) return;
    walk.field_motion = rates_->motion_at(value(walk.surface.p), *walk.field);
    walk.motion = &walk.field_motion;
  }
}

// Where a vertex slides fast, what further directions bring is as large: more of them in place of
// one. Paths of one beginning are so many at most, however deep they go.
template <class S, class Visitor>
inline int PathTracer<S, Visitor>::splits(const SurfacePoint<Place>& surface, int copies) const {
  if constexpr (std::is_same_v<Place, Dual>) {
    if (!splitting_) return 1;
    const int most = kMostSplits / copies;
    const double slides = splitting_->sliding({surface.p.x.d, surface.p.y.d, surface.p.z.d});
    return slides < most ? static_cast<int>(std::max(slides + 0.5, 1.0))
                         : most;  // also if not finite
  }
  return 1;
}

}  // namespace limn
