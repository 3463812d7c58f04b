#pragma once
// Caustics of area lights by particles, among blurred faces, over any scalar. A particle starts on
// a light, goes on by one or more smooth rays and ends on a rough surface, which is connected to
// the camera. BlurredPath leaves out what the same way, taken from the camera, finds.
//
// Faces are drawn by their weights w_k along the light's way, with the factor w_k / value(w_k).
// Where a ray meets neighbours that lie in different planes the camera's way has other weights:
// images of both differ there, which is within the blur. (The ratio of both as a factor has no
// bound: of a lens of four facets one sample of 65536 made 98 % of the sum of squares.)
//
// With Duals points move: on the light with its face, then along rays, the first of which has a
// direction that is held. So does the position on the film, where pixels' filters must be
// continuous.
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/blurred_scene.h"
#include "limn/core/rng.h"
#include "limn/integrators/run.h"

namespace limn {

class BlurredParticles {
 public:
  // Empty without Blur::particles, lights or smooth surfaces. The scene must outlive this.
  // InputError for cameras without a point to connect to.
  explicit BlurredParticles(const BlurredScene& scene);

  bool empty() const { return faces_.empty(); }
  // One of them, as SampleEstimator::sample_film has it.
  template <class S>
  bool follow(double u, const Rng& key, RayCount& rays, FilmSample& sample) const;

 private:
  struct EmittingFace {
    FaceRef piece;   // of BlurredScene::emitters()
    double density;  // of its points [1/area]
    double upto;     // the sum of shares so far
  };
  template <class S>
  class Particle;

  const BlurredScene& scene_;
  std::vector<EmittingFace> faces_;
  Vec3d center_;  // of all that smooth faces reach
  double radius_ = 0;
};

}  // namespace limn
