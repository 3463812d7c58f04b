// One path per sample of a pixel, in plain numbers.
#include "integrators/methods/radiance_estimator.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "integrators/paths/film_rays.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"

namespace limn {

RadianceEstimator::RadianceEstimator(const Scene& scene, int threads,
                                     std::shared_ptr<const FilmRegions> visible, bool closed,
                                     Numbers numbers)
    : scene_(scene),
      traced_(scene_, threads, {.closed = closed, .faces = visible ? visible->faces() : nullptr}),
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      visible_(std::move(visible)),
      numbers_(numbers),
      glossy_(is_glossy(scene_)) {}

RadianceEstimator::RadianceEstimator(const Scene& moved, const PathChoices& choices, int threads,
                                     Numbers numbers)
    : scene_(moved),
      traced_(scene_, choices, threads),
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      numbers_(numbers),
      glossy_(is_glossy(scene_)) {}

void RadianceEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  // In closed form what is left to chance is where in its pixel a sample lies: it takes two places.
  const bool closed = traced_.context().closed != nullptr;
  for (const bool mirrored : {false, true}) {
    if (mirrored && !closed) break;
    const double weight = closed ? 0.5 : 1;
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
  RayCount count;
  Tracer tracer(traced_.context(), count);
  tracer.work_wide(glossy_);
  const FilmRays rays(scene_, camera_, filter_, samples, mirrored);
  std::vector<typename Tracer::Walk> walks;
  walks.reserve(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    walks.emplace_back(samples[i].key, 0, visitor);
    if (sink.log()) {
      const StartRay<double>& start = rays.starts()[i];
      log_camera_ray(*sink.log(), rays.place(i).x, rays.place(i).y, start.origin, start.direction);
    }
  }
  if (visible_) {
    std::vector<FaceRef> faces;
    for (size_t i = 0; i < samples.size(); ++i) {
      faces.push_back(
          visible_->face_at(samples[i].at.x, samples[i].at.y, rays.place(i).x, rays.place(i).y));
    }
    tracer.follow_rays(rays.starts(), faces, walks);
  } else {
    tracer.follow_rays(rays.starts(), walks);
  }
  sink.cost(0).add(count);
  sink.cost(0).samples += samples.size();
  add(walks, samples, weight, sink);
}

template <class Walk>
void RadianceEstimator::add(const std::vector<Walk>& walks, std::span<const KeyedSample> samples,
                            double weight, SampleSink& sink) const {
  // Samples of a pixel follow each other: its sum is in memory but before and after them, as each
  // would wait for the one before.
  double* pixel = nullptr;
  Rgb<double> sum;
  const auto leave_pixel = [&] {
    for (int c = 0; pixel && c < 3; ++c) pixel[c] = sum[c];
  };
  for (size_t i = 0; i < samples.size(); ++i) {
    const Rgb<double>& radiance = walks[i].sums.radiance;
    if (walks[i].failed || !is_finite(radiance)) {
      sink.reject(samples[i].at, slot_name(0));
      continue;
    }
    if (double* const at = sink.radiance_of(samples[i].at); at != pixel) {
      leave_pixel();
      pixel = at;
      sum = {at[0], at[1], at[2]};
    }
    sum = sum + radiance * weight;
  }
  leave_pixel();
}

}  // namespace limn
