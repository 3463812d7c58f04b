#pragma once
// The radiance of a scene as an estimator: images, and differences of images.
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/film_rays.h"
#include "integrators/paths/path.h"
#include "integrators/paths/traced_scene.h"

namespace limn {

class RadianceEstimator final : public SampleEstimator {
 public:
  // The scene must outlive the estimator. closed: what surfaces scatter is known in closed form,
  // InputError if it is not.
  RadianceEstimator(const Scene& scene, int threads, bool closed = false,
                    Numbers numbers = Numbers::kIndependent);

  // The radiance of a scene that has moved, by the choices of the one that has not.
  RadianceEstimator(const Scene& moved, PathChoices& choices, int threads, Numbers numbers);

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  const char* slot_name(size_t) const override { return "radiance"; }
  Numbers numbers() const override { return numbers_; }
  int reach() const override { return reach_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;
  void add_shared(std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places,
                  SampleSink& sink) const override;

 private:
  // Calls add(walks) with what the walks of samples have come to.
  template <class Visitor, class Add>
  void trace(std::span<const KeyedSample> samples, const FilmRays& rays, Visitor* visitor,
             SampleSink& sink, const Add& add) const;
  template <class Walk>
  void add(const std::vector<Walk>& walks, std::span<const KeyedSample> samples,
           const FilmRays& rays, double weight, SampleSink& sink) const;
  // Weights of a place's pixels, once for each channel: as `SharedPlace::weights`, but the left
  // ones of a row first, as pixels lie in memory.
  using Footprint = std::array<double, size_t{3} * SharedPlace::kMostSide * SharedPlace::kMostSide>;
  Footprint footprint_of(const SharedPlace& place) const;
  void add_footprint(const PixelSample& at, const SharedPlace& place, const Footprint& footprint,
                     const Rgb<double>& radiance, SampleSink& sink) const;

  const Scene& scene_;
  std::optional<Scene> flat_;  // with the same image, in less time; none: scene_ itself
  TracedScene traced_;
  CameraView<double> camera_;
  FilterTable filter_;
  Numbers numbers_;
  bool glossy_;
  int reach_;
  Tile served_;  // pixels that shared samples serve
};

}  // namespace limn
