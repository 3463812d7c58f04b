// All lights of a scene, and what kinds of them share.
#include "limn/core/lights.h"

#include <algorithm>
#include <limits>

namespace limn {

std::optional<LightSample> DeltaLight::sample(const Vec3d& p, double choices, Rng&) const {
  const auto arrival = arriving(p);
  if (!arrival) return {};
  const LightOrigin from = origin();
  const double distance =
      from.infinite ? std::numeric_limits<double>::infinity() : length(value(from.v) - p);
  return LightSample{arrival->wo, distance, 1 / choices, {}, this};
}

std::optional<LightSample> Environment::sample(const Vec3d&, double choices, Rng& rng) const {
  const double u1 = rng.uniform();
  const double u2 = rng.uniform();
  const Drawn drawn = sample_direction(u1, u2);
  const double density = drawn.pdf / choices;
  if (!(density > 0)) return {};
  return LightSample{drawn.direction, std::numeric_limits<double>::infinity(), density, {}, this,
                     drawn.place};
}

Lights::Lights(const Scene& scene)
    : of_shape_(scene.shapes.size(), nullptr), environment_(scene.environment.get()) {
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    if (!scene.shapes[s].is_emitter) continue;
    area_lights_.push_back(make_area_light(scene, ShapeId(s)));
    of_shape_[s] = area_lights_.back().get();
    all_.push_back(of_shape_[s]);
  }
  if (environment_) all_.push_back(environment_);
  for (const auto& light : scene.delta_lights) all_.push_back(light.get());
  choices_ = static_cast<double>(all_.size());
}

std::optional<LightSample> Lights::sample(const Vec3d& p, Rng& rng) const {
  const double choice = rng.uniform() * choices_;
  const size_t index = std::min(static_cast<size_t>(choice), all_.size() - 1);
  return all_[index]->sample(p, choices_, rng);
}

}  // namespace limn
