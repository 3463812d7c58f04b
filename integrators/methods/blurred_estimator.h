#pragma once
// Images of a scene of blurred faces, and their derivatives.
#include <optional>
#include <span>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/blurred_particles.h"
#include "limn/core/parameter.h"

namespace limn {

// A scalar parameter, or one number of an array.
struct BlurredNumber {
  Parameter parameter;
  size_t component = 0;
};

class BlurredEstimator final : public SampleEstimator {
 public:
  // derived: at most kLanes, whose derivatives go to the slot; none: an image alone. The scene must
  // outlive the estimator. blur: as resolved() has it. time: of the shutter, see at_time(); none:
  // the scene is as it is.
  BlurredEstimator(const Scene& scene, const Blur& blur, std::span<const BlurredNumber> derived,
                   int threads, Numbers numbers, std::optional<double> time = {});
  // The image of a scene that has moved, by the choices of the one that has not.
  BlurredEstimator(const Scene& moved, const BlurredScene& unmoved, int threads, Numbers numbers);

  const Scene& scene() const override { return *scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "blurred"; }
  int lanes() const override { return lanes_; }
  Lanes lane_scale() const override { return lane_scale_; }
  Numbers numbers() const override { return numbers_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;
  double film_samples(size_t) const override { return particles_.empty() ? 0 : 1; }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override;

 private:
  template <class S>
  void add(const KeyedSample& sample, const CameraView<S>& view, SampleSink& sink) const;

  std::shared_ptr<const Scene> scene_;  // seeded where there are parameters
  int lanes_ = 0;
  Lanes lane_scale_;
  BlurredScene blurred_;
  BlurredParticles particles_;
  FilterTable filter_;
  Numbers numbers_;
};

// One for every kLanes of `derived`; the same at a time of the shutter, where something moves.
std::vector<std::unique_ptr<SampleEstimator>> blurred_passes(const Scene& scene, const Blur& blur,
                                                             std::span<const BlurredNumber> derived,
                                                             int threads,
                                                             std::optional<double> time = {});

// What a reader of images or derivatives of blurred faces must know.
std::string bias_of_blur(const Scene& scene, const Blur& blur);

}  // namespace limn
