#pragma once
// The path tracer's steps in eight lanes. Included by path_follow.h.
#include "integrators/paths/by_bsdf.h"
#include "integrators/paths/path.h"

namespace limn {

// evaluations[i]: of the direction *direction(walk) of the i-th walk; null: none is asked for.
template <class S, class Visitor>
template <class Direction>
inline void PathTracer<S, Visitor>::evaluate_wide(std::span<Walk* const> walks,
                                                  const Direction& direction,
                                                  Evaluation* evaluations) const {
  ByBsdf<Bsdf::Evaluation, kMostWalks> asked;
  BsdfValue values[kMostWalks];
  for (size_t i = 0; i < walks.size(); ++i) {
    const Vec3d* const wo = direction(*walks[i]);
    const Scattering<S>& scattering = *walks[i]->scattering;
    // Many lights lie behind a surface: lanes are not spent on them.
    if (!wo || !(dot(scattering.normal(), *wo) > 0)) continue;
    asked.add(scattering.bsdf(), {&scattering.normal(), &scattering.wi(), wo, &values[i]});
  }
  asked.for_each([](const Bsdf& bsdf, auto items) { bsdf.eval_with_pdf_each(items); });
  for (size_t i = 0; i < walks.size(); ++i) {
    const Vec3d* const wo = direction(*walks[i]);
    if (wo) evaluations[i] = walks[i]->scattering->limited(*wo, values[i]);
  }
}

template <class S, class Visitor>
inline void PathTracer<S, Visitor>::weigh_lights_wide(std::span<Walk* const> walks) const {
  Evaluation evaluations[kMostWalks];
  const auto is_asked = [](const Walk& walk) { return walk.light && !walk.light->light->delta(); };
  evaluate_wide(
      walks, [&](const Walk& walk) { return is_asked(walk) ? &walk.light->wo : nullptr; },
      evaluations);
  for (size_t i = 0; i < walks.size(); ++i) {
    Walk& walk = *walks[i];
    if (is_asked(walk)) {
      weigh_light(walk, evaluations[i]);
    } else {
      weigh_light(walk);
    }
  }
}

// Draws the next directions and scatters into them: how many go on, which are the first then.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::scatter_wide(std::span<Walk*> walks) {
  ByBsdf<Bsdf::Draw, kMostWalks> draws;
  for (Walk* const walk : walks) {
    if (draw_mirrored(*walk)) continue;
    const Scattering<S>& scattering = *walk->scattering;
    draws.add(scattering.bsdf(),
              {&scattering.normal(), &scattering.wi(), walk->u.data(), &walk->wo});
  }
  draws.for_each([](const Bsdf& bsdf, auto items) { bsdf.sample_each(items); });
  const auto keep = [&](const auto& step) {
    size_t kept = 0;
    for (size_t i = 0; i < walks.size(); ++i) {
      if (step(i)) walks[kept++] = walks[i];
    }
    walks = walks.first(kept);
  };
  keep([&](size_t i) { return !(walks[i]->wo == Vec3d{}); });
  Evaluation evaluations[kMostWalks];
  evaluate_wide(walks, [](const Walk& walk) { return &walk.wo; }, evaluations);
  keep([&](size_t i) {
    walks[i]->direction = walks[i]->wo;
    return scatter(*walks[i], evaluations[i]);
  });
  return walks.size();
}

}  // namespace limn
