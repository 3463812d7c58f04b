#pragma once
// Images by paths from the camera and particles from area lights. A particle is a path that starts
// on a light and ends where a surface is connected to the camera. It finds caustics of small
// lights, which paths from the camera meet by chance. Weights are those of the balance heuristic,
// by the densities of all three ways to draw a path (Veach 1997, 10.2).
#include <memory>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "limn/core/camera.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/shading.h"

namespace limn {

// InputError for cameras without a point to connect to, and for light that goes straight through
// surfaces.
void check_light_traced(const Scene& scene);

class LightTracedEstimator final : public SampleEstimator {
 public:
  // The scene must outlive the estimator.
  LightTracedEstimator(const Scene& scene, int threads, Numbers numbers);

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 2; }
  const char* slot_name(size_t slot) const override { return slot == 0 ? "paths" : "particles"; }
  // The image of particles is that of the second slot's lane.
  int lanes() const override { return 1; }
  Lanes lane_scale() const override { return {1, 1, 1, 1}; }
  Numbers numbers() const override { return numbers_; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;
  double film_samples(size_t slot) const override { return slot == 1 && !faces_.empty() ? 1 : 0; }
  int film_stream(size_t slot) const override { return static_cast<int>(slot); }
  bool sample_film(size_t slot, double u, const Rng& key, RayCount& rays,
                   FilmSample& sample) const override;

 private:
  using Surface = SurfacePoint<double>;
  // The density of points from which particles start [1/area]; 0 on surfaces that emit nothing.
  double emitted_from(const Surface& surface) const;
  // The density of a surface on the film [1/area per pixel^2]. direction: from the camera.
  double on_film(const Surface& surface, const Vec3d& origin, const Vec3d& direction,
                 const Vec3d& forward) const;
  bool is_complete(int bounces) const {
    return scene_.max_depth >= 0 && bounces + 1 >= scene_.max_depth;
  }
  Rgb<double> trace(const CameraRay<double>& camera, const Vec3d& forward, const Rng& key,
                    RayCount& rays, SampleLog* log) const;
  bool follow_particle(double u, const Rng& key, RayCount& rays, FilmSample& sample) const;
  Rgb<double> direct(const Surface& surface, const Scattering<double>& scattering,
                     const Lights::Point& place, double reached, int bounces, const Rng& key,
                     RayCount& rays) const;

  struct EmittingFace {
    FaceRef face;
    double density;  // of its points [1/area]
    double upto;     // the sum of shares so far
  };
  const Scene& scene_;
  std::unique_ptr<RayTracer> tracer_;
  Lights lights_;
  CameraView<double> view_;
  FilterTable filter_;
  Numbers numbers_;
  double pixel_area_;  // at depth 1
  double per_sample_;  // particles for each sample of every pixel
  std::vector<EmittingFace> faces_;
  std::vector<double> densities_;  // of each shape [1/area]
};

}  // namespace limn
