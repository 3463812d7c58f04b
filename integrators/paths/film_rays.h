#pragma once
// The camera's rays of several samples, in plain numbers: step by step for all of them, like the
// paths themselves (path.h).
#include <algorithm>
#include <array>
#include <span>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/walk.h"
#include "limn/core/check.h"

namespace limn {

class FilmRays {
 public:
  // At most kMostTogether samples. mirrored: see mirrored_in_pixel.
  FilmRays(const Scene& scene, const CameraView<double>& camera, const FilterTable& filter,
           std::span<const KeyedSample> samples, bool mirrored)
      : count_(samples.size()) {
    DCHECK_LE(count_, kMostTogether);
    place(scene, filter, samples, mirrored);
    start(scene, camera, samples);
  }

  // Through places in the samples' pixels.
  FilmRays(const Scene& scene, const CameraView<double>& camera,
           std::span<const KeyedSample> samples, std::span<const SharedPlace* const> places)
      : count_(samples.size()) {
    DCHECK_LE(count_, kMostTogether);
    for (size_t i = 0; i < count_; ++i) {
      places_[i] = {samples[i].at.x + places[i]->x, samples[i].at.y + places[i]->y};
    }
    start(scene, camera, samples);
  }

  const FilmPosition& place(size_t i) const { return places_[i]; }
  // See pixel_filter_weight.
  double weight(const Film& film, const FilterTable& filter, const PixelSample& at,
                size_t i) const {
    return pixel_filter_weight(film, filter, at.x, at.y, places_[i]);
  }
  std::span<const StartRay<double>> starts() const { return {starts_.data(), count_}; }

 private:
  void start(const Scene& scene, const CameraView<double>& camera,
             std::span<const KeyedSample> samples) {
    std::array<CameraRay<double>, kMostTogether> rays;
    if (scene.camera.has_lens()) {
      std::array<LensPoint, kMostTogether> lenses;
      sample_lenses(scene.camera, samples, lenses);
      for (size_t i = 0; i < count_; ++i) rays[i] = ray_at(camera, {places_[i], lenses[i]});
    } else {
      find_rays(camera, {places_.data(), count_}, rays);
    }
    for (size_t i = 0; i < count_; ++i) {
      renew(starts_[i].ray, [&] { return camera_ray(scene, rays[i]); });
      starts_[i].origin = rays[i].origin;
      starts_[i].direction = rays[i].direction;
    }
  }
  void place(const Scene& scene, const FilterTable& filter, std::span<const KeyedSample> samples,
             bool mirrored) {
    std::array<Rng::Stream, kMostTogether> streams;
    for (size_t i = 0; i < count_; ++i) streams[i] = {&samples[i].key, 0};
    std::array<std::array<double, 2>, kMostTogether> numbers;
    Rng::draw(Purpose::kFilm, {streams.data(), count_}, numbers.data());
    for (size_t i = 0; i < count_; ++i) {
      const PixelSample& at = samples[i].at;
      places_[i] = sample_pixel_filter(scene.film, filter, at.x, at.y, numbers[i]);
      if (mirrored) places_[i] = mirrored_in_pixel(scene.film, at.x, at.y, places_[i]);
    }
  }

  size_t count_;
  std::array<FilmPosition, kMostTogether> places_;
  std::array<StartRay<double>, kMostTogether> starts_;
};

}  // namespace limn
