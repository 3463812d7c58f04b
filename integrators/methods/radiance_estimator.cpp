// One path per sample of a pixel, in plain numbers.
#include "integrators/methods/radiance_estimator.h"

#include <array>
#include <vector>

#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"

namespace limn {

// The scene without normals that are interpolated in vain; none if it has no such normals.
static std::optional<Scene> without_idle_normals(const Scene& scene) {
  std::optional<Scene> changed;
  for (size_t s = 0; s < scene.shapes.size(); ++s) {
    if (!has_idle_normals(scene.shapes[s].mesh)) continue;
    if (!changed) changed = scene;
    changed->shapes[s].mesh.normal_source = NormalSource::kFace;
  }
  return changed;
}

RadianceEstimator::RadianceEstimator(const Scene& scene, int threads, bool closed, Numbers numbers)
    : scene_(scene),
      flat_(without_idle_normals(scene)),
      traced_(flat_ ? *flat_ : scene_, threads, {.closed = closed, .image = true}),
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      numbers_(numbers),
      glossy_(is_glossy(scene_)),
      reach_(closed ? 0 : shared_reach(scene_.film, numbers)),
      served_(served_pixels(scene_.film)) {}

RadianceEstimator::RadianceEstimator(const Scene& moved, PathChoices& choices, int threads,
                                     Numbers numbers)
    : scene_(moved),
      traced_(scene_, choices, threads),
      camera_(scene_.camera),
      filter_(scene_.film.filter),
      numbers_(numbers),
      glossy_(is_glossy(scene_)),
      reach_(shared_reach(scene_.film, numbers)),
      served_(served_pixels(scene_.film)) {}

void RadianceEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  // In closed form what is left to chance is where in its pixel a sample lies: it takes two places.
  const bool closed = traced_.context().closed != nullptr;
  for (const bool mirrored : {false, true}) {
    if (mirrored && !closed) break;
    const double weight = closed ? 0.5 : 1;
    if (sink.log()) {
      PathLog visitor(*sink.log());
      for (const KeyedSample& sample : samples) {
        const std::span<const KeyedSample> one(&sample, 1);
        const FilmRays rays(scene_, camera_, filter_, one, mirrored);
        trace(one, rays, &visitor, sink,
              [&](const auto& walks) { add(walks, one, rays, weight, sink); });
      }
    } else {
      const FilmRays rays(scene_, camera_, filter_, samples, mirrored);
      trace(samples, rays, static_cast<NoVisitor*>(nullptr), sink,
            [&](const auto& walks) { add(walks, samples, rays, weight, sink); });
    }
  }
}

template <class Visitor, class Add>
void RadianceEstimator::trace(std::span<const KeyedSample> samples, const FilmRays& rays,
                              Visitor* visitor, SampleSink& sink, const Add& add) const {
  using Tracer = PathTracer<double, Visitor>;
  static_assert(kMostTogether <= Tracer::kMostWalks);
  RayCount count;
  Tracer tracer(traced_.context(), count);
  tracer.work_wide(glossy_);
  std::vector<typename Tracer::Walk> walks;
  walks.reserve(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    walks.emplace_back(samples[i].key, 0, visitor);
    if (sink.log()) {
      const StartRay<double>& start = rays.starts()[i];
      log_camera_ray(*sink.log(), rays.place(i).x, rays.place(i).y, start.origin, start.direction);
    }
  }
  tracer.follow_rays(rays.starts(), walks);
  sink.cost(0).add(count);
  sink.cost(0).samples += samples.size();
  add(walks);
}

template <class Walk>
void RadianceEstimator::add(const std::vector<Walk>& walks, std::span<const KeyedSample> samples,
                            const FilmRays& rays, double weight, SampleSink& sink) const {
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
    if (double* const at = sink.radiance_at(samples[i].at.x, samples[i].at.y); at != pixel) {
      leave_pixel();
      pixel = at;
      sum = {at[0], at[1], at[2]};
    }
    sum = sum + radiance * (weight * rays.weight(scene_.film, filter_, samples[i].at, i));
  }
  leave_pixel();
}

void RadianceEstimator::add_shared(std::span<const KeyedSample> samples,
                                   std::span<const SharedPlace* const> places,
                                   SampleSink& sink) const {
  const FilmRays rays(scene_, camera_, samples, places);
  const auto add = [&](const auto& walks) {
    Footprint footprint;
    const SharedPlace* place = nullptr;
    for (size_t i = 0; i < samples.size(); ++i) {
      const Rgb<double>& radiance = walks[i].sums.radiance;
      if (walks[i].failed || !is_finite(radiance)) {
        sink.reject(samples[i].at, slot_name(0));
        continue;
      }
      if (places[i] != place) footprint = footprint_of(*(place = places[i]));
      add_footprint(samples[i].at, *place, footprint, radiance, sink);
    }
  };
  if (sink.log()) {
    PathLog visitor(*sink.log());
    trace(samples, rays, &visitor, sink, add);
  } else {
    trace(samples, rays, static_cast<NoVisitor*>(nullptr), sink, add);
  }
}

RadianceEstimator::Footprint RadianceEstimator::footprint_of(const SharedPlace& place) const {
  Footprint footprint;
  const size_t side = 2 * reach_ + 1;
  for (size_t i = 0; i < side * side; ++i) {
    const size_t mirrored = side - 1 - i % side;
    for (size_t c = 0; c < 3; ++c) footprint[3 * i + c] = place.weights[i - i % side + mirrored];
  }
  return footprint;
}

// Row by row, where all pixels are served.
void RadianceEstimator::add_footprint(const PixelSample& at, const SharedPlace& place,
                                      const Footprint& footprint, const Rgb<double>& radiance,
                                      SampleSink& sink) const {
  if (!served_.holds(at.x - reach_, at.y - reach_) ||
      !served_.holds(at.x + reach_, at.y + reach_)) {
    sink.add_radiance(at, radiance, 1, {&place});
    return;
  }
  const int row = 3 * (2 * reach_ + 1);
  std::array<double, 3 * SharedPlace::kMostSide> colours;
  for (int i = 0; i < row; ++i) colours[i] = radiance[i % 3];
  const double* weights = footprint.data();
  for (int y = at.y + reach_; y >= at.y - reach_; --y, weights += row) {
    double* const pixels = sink.radiance_at(at.x - reach_, y);
    for (int i = 0; i < row; ++i) pixels[i] += weights[i] * colours[i];
  }
}

}  // namespace limn
