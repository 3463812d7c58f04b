#pragma once
// Images of a scene of blurred faces, and their derivatives.
#include <span>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/blurred_scene.h"
#include "limn/core/parameter.h"

namespace limn {

class BlurredEstimator final : public SampleEstimator {
 public:
  // parameters: at most kLanes, whose derivatives go to the slot; none: an image alone. The scene
  // must outlive the estimator. blur: as resolved() has it.
  BlurredEstimator(const Scene& scene, const Blur& blur, std::span<const Parameter> parameters,
                   int threads, Numbers numbers);
  // The image of a scene that has moved, by the choices of the one that has not.
  BlurredEstimator(const Scene& moved, const BlurredScene& unmoved, int threads, Numbers numbers);

  const Scene& scene() const override { return *scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "blurred"; }
  int lanes() const override { return lanes_; }
  Lanes lane_scale() const override { return lane_scale_; }
  Numbers numbers() const override { return numbers_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

 private:
  template <class S>
  void add(const KeyedSample& sample, const CameraView<S>& view, SampleSink& sink) const;

  std::shared_ptr<const Scene> scene_;  // seeded where there are parameters
  int lanes_ = 0;
  Lanes lane_scale_;
  BlurredScene blurred_;
  FilterTable filter_;
  Numbers numbers_;
};

// What a reader of images or derivatives of blurred faces must know.
std::string bias_of_blur(const Scene& scene, const Blur& blur);

}  // namespace limn
