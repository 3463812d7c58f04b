#pragma once
// Sampling directions towards the light of a scene.
#include <vector>

#include "limn/core/ray_tracer.h"
#include "limn/core/rng.h"
#include "limn/core/scene.h"

namespace limn {

struct LightSample {
  Vec3d wo;             // unit direction from the shading point
  double distance = 0;  // 1e300 for the environment
  double pdf = 0;       // [1/sr], of this light and direction
  FaceRef face;         // of the emitter; invalid for the environment
};

// Chooses one emitter uniformly (every emitting shape and the environment is one), then a point
// uniform in area or a direction of the environment. Directions are what is sampled: while a
// parameter moves the scene they are held fixed, so densities are constants.
class Lights {
 public:
  explicit Lights(const Scene& scene);

  bool empty() const { return count_ == 0; }
  // False if the chosen point shines away from p: a sample of value zero.
  bool sample(const Vec3d& p, Rng& rng, LightSample& sample) const;
  // The density with which `sample` at a point that sees this face from `distance` along the unit
  // direction wo draws wo.
  double pdf_face(FaceRef face, const Vec3d& n_g, const Vec3d& wo, double distance) const;
  double pdf_environment(const Vec3d& wo) const;

 private:
  struct AreaLight {
    uint32_t shape;
    double area;
    std::vector<double> cumulative;  // F, of face areas
  };
  bool sample_area(const AreaLight& light, const Vec3d& p, Rng& rng, LightSample& sample) const;

  const Scene& scene_;
  std::vector<AreaLight> area_lights_;
  std::vector<double> inverse_area_;  // per shape, 0 where not a light
  size_t count_ = 0;
};

}  // namespace limn
