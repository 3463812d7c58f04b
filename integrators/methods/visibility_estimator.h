#pragma once
// How open the sky is and direct light, at what a camera sees: by lines between silhouettes or by
// rays. All random numbers of a pixel are low-discrepancy points (Rng::even).
#include <memory>
#include <vector>

#include "integrators/contours/line_light.h"
#include "integrators/estimates/sample_estimator.h"
#include "integrators/paths/camera_path.h"
#include "limn/core/camera.h"
#include "limn/integrators/render.h"

namespace limn {

class VisibilityEstimator final : public SampleEstimator {
 public:
  // The scene must outlive it. InputError where the method does not know the scene's light, see
  // LineLight::check, by rays check_direct_light; and for options out of range.
  VisibilityEstimator(const Scene& scene, const RunSettings& settings,
                      const RenderOptions& options);

  const Scene& scene() const override { return scene_; }
  size_t slots() const override { return 1; }
  Numbers numbers() const override { return Numbers::kEvenInRun; }
  const char* slot_name(size_t) const override { return "radiance"; }
  void add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const override;

  // By lines alone: what does not come from the environment, while what does goes to the record,
  // `weight` times.
  Rgb<double> record(const PixelSample& at, double weight, SkyRecord& record) const;

  // Sums over lines that ended above the tolerance, so far.
  int64_t missed() const { return lines_ ? lines_->missed() : 0; }

 private:
  // Which part of the light a point of the film is for: emitters and sky may have their own points.
  enum class Source { kAll, kEmitters, kSky = 3 };  // as numbers, of streams of random numbers
  struct Look {
    Source source;
    int points;  // of the film in a sample of a pixel
  };
  // A point of the film: which of a pixel's, and what of the light it is for.
  struct Point {
    PixelSample at;
    Source source;
    uint64_t number;    // among the pixel's of this source
    bool shows;         // what shines at the camera belongs to it
    SkyRecord* record;  // that takes what comes from the environment, or null
    double weight;      // there
    bool has(Source s) const { return source == s || source == Source::kAll; }
  };
  // What it sees.
  struct Seen {
    const Point& point;
    const SurfacePoint<double>& surface;
    Vec3d up, n;  // geometric and shading normal, towards the viewer
    const Scattering<double>& scattering;
    RayCount& rays;
  };
  struct RayEmitter {
    ShapeId shape;
    std::vector<double> areas;  // summed over its faces
  };
  void add_emitters();
  std::vector<Look> looks() const;
  // record, weight: see Point.
  Rgb<double> sample(const PixelSample& at, SampleLog* log, RayCount& rays,
                     SkyRecord* record = nullptr, double weight = 1) const;
  Rgb<double> film_point(const Point& point, SampleLog* log, RayCount& rays) const;
  // The stream of a point, or of a ray from there.
  Rng even(const Point& point, uint64_t number) const;
  Rgb<double> by_lines(const Seen& seen) const;
  Rgb<double> by_rays(const Seen& seen) const;
  Rgb<double> emitter_ray(const RayEmitter& emitter, const Seen& seen, double u1, double u2) const;
  Rgb<double> sky_ray(const Seen& seen, double u1, double u2) const;
  bool is_open(const Seen& seen, const Vec3d& direction) const;

  const Scene& scene_;
  std::unique_ptr<RayTracer> tracer_;
  uint64_t seed_;
  RenderOptions options_;
  std::unique_ptr<LineLight> lines_;  // null: by rays
  std::vector<RayEmitter> emitters_;
  CameraView<double> camera_;
  FilterTable filter_;
  std::vector<Look> looks_;
};

}  // namespace limn
