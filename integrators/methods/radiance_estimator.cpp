// One path per sample of a pixel, in plain numbers.
#include "integrators/methods/radiance_estimator.h"

#include <utility>
#include <vector>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"

namespace limn {

RadianceEstimator::RadianceEstimator(const Scene& scene, int threads,
                                     std::shared_ptr<const FilmRegions> visible, bool closed,
                                     bool even)
    : scene_(scene),
      tracer_(make_embree_tracer(scene_, threads, visible ? visible->faces() : nullptr)),
      lights_(scene_),
      closed_(closed ? std::make_unique<ClosedLight>(scene_, threads) : nullptr),
      mirrored_(closed ? nullptr : MirroredLight::make(scene_, lights_)),
      context_{scene_, *tracer_, lights_, closed_.get(), nullptr, mirrored_.get()},
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      visible_(std::move(visible)),
      even_(even) {}

RadianceEstimator::RadianceEstimator(const Scene& moved, const Choices& choices, int threads)
    : scene_(moved),
      tracer_(make_embree_tracer(scene_, threads)),
      lights_(scene_, &choices.lights),
      context_{scene_,          *tracer_, lights_, nullptr, nullptr, choices.mirrored.get(),
               &choices.unmoved},
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      even_(false) {}

void RadianceEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  // In closed form what is left to chance is where in its pixel a sample lies: it takes two places.
  for (const bool mirrored : {false, true}) {
    if (mirrored && !closed_) break;
    const double weight = closed_ ? 0.5 : 1;
    if (sink.log()) {
      PathLog visitor(*sink.log());
      for (const KeyedSample& sample : samples) {
        trace({&sample, 1}, mirrored, weight, &visitor, sink);
      }
    } else {
      trace(samples, mirrored, weight, static_cast<NoVisitor*>(nullptr), sink);
    }
  }
}

template <class Visitor>
void RadianceEstimator::trace(std::span<const KeyedSample> samples, bool mirrored, double weight,
                              Visitor* visitor, SampleSink& sink) const {
  using Tracer = PathTracer<double, Visitor>;
  static_assert(kMostTogether <= Tracer::kMostWalks);
  RayCount rays;
  Tracer tracer(context_, rays);
  std::vector<typename Tracer::Walk> walks;
  walks.reserve(samples.size());
  std::vector<StartRay<double>> starts(samples.size());
  std::vector<FilmPosition> places;
  for (const auto& [at, key] : samples) {
    FilmPosition film = sample_pixel_filter(scene_.film, filter_, at.x, at.y, key);
    if (mirrored) film = mirrored_in_pixel(scene_.film, at.x, at.y, film);
    const auto ray = camera_.ray(film.x, film.y);
    if (sink.log()) log_camera_ray(*sink.log(), film.x, film.y, ray.origin, ray.direction);
    walks.emplace_back(key, 0, visitor);
    StartRay<double>& start = starts[walks.size() - 1];
    renew(start.ray, [&] { return camera_ray(scene_, ray); });
    start.origin = ray.origin;
    start.direction = ray.direction;
    if (visible_) places.push_back(film);
  }
  if (visible_) {
    std::vector<FaceRef> faces;
    for (size_t i = 0; i < samples.size(); ++i) {
      faces.push_back(
          visible_->face_at(samples[i].at.x, samples[i].at.y, places[i].x, places[i].y));
    }
    tracer.follow_rays(starts, faces, walks);
  } else {
    tracer.follow_rays(starts, walks);
  }
  sink.cost(0).add(rays);
  sink.cost(0).samples += samples.size();
  for (size_t i = 0; i < samples.size(); ++i) {
    if (!walks[i].failed && is_finite(walks[i].sums.radiance)) {
      sink.add_radiance(samples[i].at, walks[i].sums.radiance, weight);
    } else {
      sink.reject(samples[i].at, slot_name(0));
    }
  }
}

}  // namespace limn
