#pragma once
// All lights of a scene, one of which is chosen at a time.
#include <memory>
#include <span>
#include <vector>

#include "limn/core/light.h"
#include "limn/core/scene.h"

namespace limn {

// Chooses one light uniformly: every emitting shape is one, in their order, then the environment,
// then the delta lights in the order of the file. The scene must outlive it.
class Lights {
 public:
  explicit Lights(const Scene& scene);

  bool empty() const { return all_.empty(); }
  // Whether any shape emits.
  bool on_shapes() const { return !area_lights_.empty(); }
  std::span<const Light* const> all() const { return all_; }

  // None: a sample of value zero (see Light::sample).
  std::optional<LightSample> sample(const Vec3d& p, Rng& rng) const;
  // The density [1/sr] with which `sample` draws what a ray sees: an emitting shape, or, where it
  // leaves the scene, the environment (there must be one).
  double pdf(ShapeId shape, const LightView& view) const {
    return of_shape_[shape.index()]->pdf(view, choices_);
  }
  double pdf_environment(const Vec3d& wo) const {
    return environment_->pdf_solid_angle(wo) / choices_;
  }
  // With the radiance that a ray along the held direction wo sees there.
  template <class S>
  Environment::Sight<S> environment(const Vec3d& wo) const {
    Environment::Sight<S> sight;
    environment_->look(wo, sight);
    sight.pdf /= choices_;
    return sight;
  }

 private:
  std::vector<std::unique_ptr<Light>> area_lights_;
  std::vector<const Light*> all_;
  std::vector<const Light*> of_shape_;  // null where a shape emits nothing
  const Environment* environment_;      // null if none
  double choices_;                      // how many there are
};

}  // namespace limn
