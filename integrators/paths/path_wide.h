#pragma once
// The path tracer's steps in eight lanes, in plain numbers. Included by path_follow.h.
#include <array>
#include <cstddef>
#include <span>
#include <utility>

#include "integrators/paths/path.h"

namespace limn {

// At most kMost items, each with a key: an object of type Key.
template <class Key, class Item, size_t kMost>
class Grouped {
 public:
  void add(const Key& key, const Item& item) {
    keys_[count_] = &key;
    items_[count_++] = item;
  }
  // Calls f(key, items of that key) once per key. Reorders the items.
  template <class F>
  void for_each(const F& f) {
    for (size_t first = 0, last = 0; first < count_; first = last) {
      const Key* const key = keys_[first];
      for (size_t i = last = first; i < count_; ++i) {
        if (keys_[i] != key) continue;
        std::swap(keys_[i], keys_[last]);
        std::swap(items_[i], items_[last++]);
      }
      f(*key, std::span<const Item>(&items_[first], last - first));
    }
  }

 private:
  size_t count_ = 0;
  std::array<const Key*, kMost> keys_;
  std::array<Item, kMost> items_;
};

// Of the vertices that will scatter.
template <class S, class Visitor>
inline void PathTracer<S, Visitor>::place_lights_wide(std::span<Walk* const> walks) const {
  if (c_.closed) return;
  const Vec3d* points[kMostWalks];
  Lights::Point* places[kMostWalks];
  size_t count = 0;
  for (Walk* const walk : walks) {
    if (is_complete(walk->bounces)) continue;
    points[count] = &walk->surface.p;
    places[count++] = &walk->lights;
  }
  c_.lights.at({points, count}, {places, count});
}

// then(walk, evaluation): of the direction *direction(walk) of each walk where that lies in front
// of the surface, or light passes, in a new order; nothing is scattered into the others.
template <class S, class Visitor>
template <class Direction, class Then>
inline void PathTracer<S, Visitor>::evaluate_wide(std::span<Walk*> walks,
                                                  const Direction& direction,
                                                  const Then& then) const {
  size_t count = 0;
  for (Walk* const walk : walks) {
    walks[count] = walk;
    const Scattering<Place>& scattering = *walk->scattering;
    count += scattering.bsdf().lobes().below || dot(scattering.normal(), *direction(*walk)) > 0;
  }
  Grouped<Bsdf, Bsdf::Evaluation, kMostWalks> queries;
  BsdfValue values[kMostWalks];
  for (size_t i = 0; i < count; ++i) {
    const Scattering<Place>& scattering = *walks[i]->scattering;
    queries.add(scattering.bsdf(), {&scattering.normal(), &scattering.wi(), direction(*walks[i]),
                                    &values[i], scattering.at()});
  }
  queries.for_each([](const Bsdf& bsdf, auto items) { bsdf.eval_with_pdf_each(items); });
  for (size_t i = 0; i < count; ++i) {
    Walk& walk = *walks[i];
    then(walk, coloured(walk, walk.scattering->held(values[i]), *direction(walk)));
  }
}

template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::weigh_lights_wide(std::span<Walk* const> walks,
                                                        Walk** lit) const {
  Walk* weighed[kMostWalks];
  size_t count = 0, shining = 0;
  const auto keep = [&](Walk& walk, bool shines) {
    lit[shining] = &walk;
    shining += shines;
  };
  for (Walk* const walk : walks) {
    if (!walk->light) continue;
    if (walk->light->light->delta()) {
      weigh_light(*walk);
      keep(*walk, walk->light.has_value());
    } else {
      weighed[count++] = walk;
    }
  }
  evaluate_wide(
      {weighed, count}, [](const Walk& walk) { return &walk.light->wo; },
      [&](Walk& walk, const Evaluation& evaluation) { keep(walk, weigh_light(walk, evaluation)); });
  return shining;
}

// Draws the next directions and scatters into them: how many go on, which are the first then.
template <class S, class Visitor>
inline size_t PathTracer<S, Visitor>::scatter_wide(std::span<Walk*> walks) {
  Grouped<Bsdf, Bsdf::Draw, kMostWalks> draws;
  for (Walk* const walk : walks) {
    if (draw_mirrored(*walk)) continue;
    const Scattering<Place>& scattering = *walk->scattering;
    draws.add(scattering.bsdf(),
              {&scattering.normal(), &scattering.wi(), walk->u.data(), &walk->wo, scattering.at()});
  }
  draws.for_each([](const Bsdf& bsdf, auto items) { bsdf.sample_each(items); });
  size_t drawn = 0, kept = 0;
  for (Walk* const walk : walks) {
    walks[drawn] = walk;
    drawn += !(walk->wo == Vec3d{});
  }
  evaluate_wide(
      walks.first(drawn), [](const Walk& walk) { return &walk.wo; },
      [&](Walk& walk, const Evaluation& evaluation) {
        walk.direction = walk.wo;
        walks[kept] = &walk;
        kept += scatter(walk, evaluation);
      });
  return kept;
}

// What the camera's rays see that meet nothing; `rest`, while that is fetched.
template <class S, class Visitor>
template <class Rest>
inline void PathTracer<S, Visitor>::see_sky_wide(std::span<const StartRay<Place>> rays,
                                                 std::span<Walk> walks, const Rest& rest) const {
  Walk* leaving[kMostWalks];
  size_t count = 0;
  for (size_t i = 0; i < walks.size(); ++i) {
    Walk& walk = walks[i];
    if (walk.found || walk.failed || !shows_sky(walk.bounces)) continue;
    walk.wo = rays[i].direction;
    leaving[count++] = &walk;
  }
  if (count > 0) find_sky({leaving, count});
  rest();
  for (size_t i = 0; i < count; ++i) {
    Walk& walk = *leaving[i];
    if constexpr (kColoursAlone<S, Visitor>) {
      if (colours_->of_sky()) {
        walk.sums.radiance = escaped(walk.wo, walk.bounces);
        continue;
      }
    }
    const Rgb<double> held = c_.scene.environment->radiance_at(walk.wo, walk.sky);
    walk.sums.radiance = detail::in_scalar<S>(held);
  }
}

}  // namespace limn
