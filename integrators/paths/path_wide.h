#pragma once
// The path tracer's steps in eight lanes, in plain numbers. Included by path_follow.h.
#include "integrators/paths/path.h"
#include "limn/core/grouped.h"

namespace limn {

// Of the vertices that will scatter.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::place_lights_wide(std::span<Walk* const> walks) const {
  if (c_.closed) return;
  const Vec3d* points[kMostWalks];
  Lights::Place* places[kMostWalks];
  size_t count = 0;
  for (Walk* const walk : walks) {
    if (is_complete(walk->bounces)) continue;
    points[count] = &walk->surface.p;
    places[count++] = &walk->lights;
  }
  c_.lights.at({points, count}, {places, count});
}

// then(i, evaluation): of the direction *direction(walk) of the i-th walk.
template <class S, class Visitor>
template <class Direction, class Then>
inline void PathTracer<S, Visitor>::evaluate_wide(std::span<Walk* const> walks,
                                                  const Direction& direction,
                                                  const Then& then) const {
  Grouped<Bsdf, Bsdf::Evaluation, kMostWalks> asked;
  BsdfValue values[kMostWalks];
  for (size_t i = 0; i < walks.size(); ++i) {
    const Vec3d* const wo = direction(*walks[i]);
    const Scattering<S>& scattering = *walks[i]->scattering;
    // Many lights lie behind a surface: lanes are not spent on them.
    if (!(dot(scattering.normal(), *wo) > 0)) continue;
    asked.add(scattering.bsdf(), {&scattering.normal(), &scattering.wi(), wo, &values[i]});
  }
  asked.for_each([](const Bsdf& bsdf, auto items) { bsdf.eval_with_pdf_each(items); });
  for (size_t i = 0; i < walks.size(); ++i) {
    then(i, walks[i]->scattering->limited(*direction(*walks[i]), values[i]));
  }
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::weigh_lights_wide(std::span<Walk* const> walks) const {
  Walk* lit[kMostWalks];
  size_t count = 0;
  for (Walk* const walk : walks) {
    if (!walk->light) continue;
    if (walk->light->light->delta()) {
      weigh_light(*walk);
    } else {
      lit[count++] = walk;
    }
  }
  evaluate_wide(
      {lit, count}, [](const Walk& walk) { return &walk.light->wo; },
      [&](size_t i, const Evaluation& evaluation) { weigh_light(*lit[i], evaluation); });
}

// Draws the next directions and scatters into them: how many go on, which are the first then.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::scatter_wide(std::span<Walk*> walks) {
  Grouped<Bsdf, Bsdf::Draw, kMostWalks> draws;
  for (Walk* const walk : walks) {
    if (draw_mirrored(*walk)) continue;
    const Scattering<S>& scattering = *walk->scattering;
    draws.add(scattering.bsdf(),
              {&scattering.normal(), &scattering.wi(), walk->u.data(), &walk->wo});
  }
  draws.for_each([](const Bsdf& bsdf, auto items) { bsdf.sample_each(items); });
  size_t drawn = 0, kept = 0;
  for (Walk* const walk : walks) {
    if (!(walk->wo == Vec3d{})) walks[drawn++] = walk;
  }
  evaluate_wide(
      walks.first(drawn), [](const Walk& walk) { return &walk.wo; },
      [&](size_t i, const Evaluation& evaluation) {
        walks[i]->direction = walks[i]->wo;
        if (scatter(*walks[i], evaluation)) walks[kept++] = walks[i];
      });
  return kept;
}

// Where rays along walk.wo leave the scene.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::find_sky_wide(std::span<Walk* const> walks) const {
  if (!c_.scene.environment) return;
  Environment::Found found[kMostWalks];
  size_t count = 0;
  for (Walk* const walk : walks) {
    if (!walk->found) found[count++] = {&walk->wo, &walk->sky};
  }
  c_.scene.environment->find_each({found, count});
}

// What the camera's rays see that meet nothing; `rest`, while that is fetched.
template <class S, class Visitor>
template <class Rest>
inline void PathTracer<S, Visitor>::see_sky_wide(std::span<const StartRay<S>> rays,
                                                 std::span<Walk> walks, const Rest& rest) const {
  Walk* leaving[kMostWalks];
  size_t count = 0;
  for (size_t i = 0; i < walks.size(); ++i) {
    Walk& walk = walks[i];
    if (walk.found || walk.failed || !shows_sky(walk.bounces)) continue;
    walk.wo = rays[i].direction;
    leaving[count++] = &walk;
  }
  find_sky_wide({leaving, count});
  rest();
  for (size_t i = 0; i < count; ++i) {
    Walk& walk = *leaving[i];
    walk.sums.radiance = c_.scene.environment->radiance_at(walk.wo, walk.sky);
  }
}

}  // namespace limn
