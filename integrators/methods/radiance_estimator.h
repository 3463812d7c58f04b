#pragma once
// The radiance of a scene as an estimator: images, and differences of images.
#include <memory>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/film/film_regions.h"
#include "integrators/paths/path.h"
#include "integrators/paths/traced_scene.h"

namespace limn {

class RadianceEstimator final : public SampleEstimator {
 public:
  // The scene must outlive the estimator. visible: what its film shows; null: rays tell. closed:
  // what surfaces scatter is known in closed form, InputError if it is not.
  RadianceEstimator(const Scene& scene, int threads,
                    std::shared_ptr<const FilmRegions> visible = nullptr, bool closed = false,
                    Numbers numbers = Numbers::kIndependent);

  // The radiance of a scene that has moved, by the choices of the one that has not.
  RadianceEstimator(const Scene& moved, const PathChoices& choices, int threads, Numbers numbers);

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "radiance"; }
  Numbers numbers() const override { return numbers_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

 private:
  template <class Visitor>
  void trace(std::span<const KeyedSample> samples, bool mirrored, double weight, Visitor* visitor,
             SampleSink& sink) const;
  // What the walks of samples have come to.
  template <class Walk>
  void add(const std::vector<Walk>& walks, std::span<const KeyedSample> samples, double weight,
           SampleSink& sink) const;

  const Scene& scene_;
  TracedScene traced_;
  CameraView<double> camera_;
  FilterTable filter_;
  std::shared_ptr<const FilmRegions> visible_;
  Numbers numbers_;
  bool glossy_;
};

}  // namespace limn
