#pragma once
// How open the sky is and direct light, at what a camera sees: by lines between silhouettes, or by
// rays. All random numbers of a pixel are even (Rng::even).
#include <memory>
#include <vector>

#include "integrators/estimates/sample_estimator.h"
#include "integrators/terms/line_light.h"
#include "limn/core/camera.h"
#include "limn/integrators/render.h"

namespace limn {

class VisibilityEstimator final : public SampleEstimator {
 public:
  // The scene must outlive it. seed: of the run. InputError where the method does not know the
  // scene's light, see LineLight::check, by rays check_direct_light; and for options out of range.
  VisibilityEstimator(const Scene& scene, int threads, uint64_t seed, bool by_lines,
                      const RenderOptions& options);

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  bool is_even() const override { return true; }
  const char* slot_name(size_t) const override { return "radiance"; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

  // Sums over lines that ended above the tolerance, so far.
  int64_t missed() const { return lines_ ? lines_->missed() : 0; }

 private:
  // What one point sees.
  struct Seen {
    const SurfacePoint<double>& surface;
    Vec3d up, n;  // geometric and shading normal, towards the viewer
    const Scattering<double>& scattering;
    const PixelSample& at;
    uint64_t number;  // of the point of the film among the pixel's
    RayCount& rays;
  };
  struct RayLamp {
    ShapeId shape;
    std::vector<double> areas;  // summed over its faces
  };
  void add_lamps();
  // What one point of the film shows of it all; of all but light of the environment that is
  // scattered; of that alone.
  enum class Part { kAll, kNoSky, kSky };
  Rgb<double> sample(const KeyedSample& at, SampleSink& sink, RayCount& rays) const;
  Rgb<double> film_point(const PixelSample& at, uint64_t number, Part part, SampleSink& sink,
                         RayCount& rays) const;
  // The stream of a pixel's point of the film, or of a ray from there.
  Rng even(const PixelSample& at, uint64_t number, Part part) const;
  Rgb<double> by_lines(const Seen& seen, Part part) const;
  Rgb<double> by_rays(const Seen& seen, Part part) const;
  Rgb<double> lamp_ray(const RayLamp& lamp, const Seen& seen, double u1, double u2) const;
  Rgb<double> sky_ray(const Seen& seen, double u1, double u2) const;
  bool is_open(const Seen& seen, const Vec3d& direction) const;

  const Scene& scene_;
  std::unique_ptr<RayTracer> tracer_;
  uint64_t seed_;
  RenderOptions options_;
  std::unique_ptr<LineLight> lines_;  // null: by rays
  std::vector<RayLamp> lamps_;
  CameraView<double> camera_;
  FilterTable filter_;
};

}  // namespace limn
