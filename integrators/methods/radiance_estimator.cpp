// One path per sample of a pixel, in plain numbers.
#include "integrators/methods/radiance_estimator.h"

#include <limits>
#include <utility>

#include "integrators/terms/camera_path.h"
#include "integrators/terms/path_log.h"

namespace limn {

RadianceEstimator::RadianceEstimator(const Scene& scene, int threads,
                                     std::shared_ptr<const FilmRegions> visible, bool closed)
    : scene_(scene),
      tracer_(make_embree_tracer(scene_, threads)),
      lights_(scene_),
      closed_(closed ? std::make_unique<ClosedLight>(scene_, threads) : nullptr),
      context_{scene_, *tracer_, lights_, closed_.get()},
      camera_(scene_.camera),
      visible_(std::move(visible)) {}

void RadianceEstimator::add_pixel(const PixelSample& at, const Rng& key, SampleSink& sink) const {
  const FilmPosition film = sample_pixel_filter(scene_.film, at.x, at.y, key);
  const auto ray = camera_.ray(film.x, film.y);
  RayCount rays;
  const auto trace = [&](auto& visitor) {
    PathTracer<double, std::decay_t<decltype(visitor)>> path(context_, rays, visitor);
    try {
      if (visible_) {
        const FaceRef face = visible_->face_at(at.x, at.y, film.x, film.y);
        if (!face.shape.valid()) return path.escaped(ray.direction, 0);
        return path.from_surface(surface_on_ray(scene_, face, ray.origin, ray.direction),
                                 -ray.direction, 0, key, nullptr);
      }
      return path.from_ray(camera_ray(scene_, ray), ray.origin, ray.direction, 0, key);
    } catch (const UntraceableRay&) {
      return grey(std::numeric_limits<double>::quiet_NaN());
    }
  };
  Rgb<double> radiance;
  if (SampleLog* log = sink.log()) {
    log_camera_ray(*log, film.x, film.y, ray.origin, ray.direction);
    PathLog visitor(*log);
    radiance = trace(visitor);
  } else {
    NoVisitor nothing;
    radiance = trace(nothing);
  }
  sink.cost(0).add(rays);
  ++sink.cost(0).samples;
  if (is_finite(radiance)) {
    sink.add_radiance(at, radiance, 1);
  } else {
    sink.reject(at, slot_name(0));
  }
}

}  // namespace limn
