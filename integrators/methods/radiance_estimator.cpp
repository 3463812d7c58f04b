// One path per sample of a pixel, in plain numbers.
#include "integrators/methods/radiance_estimator.h"

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"
#include "limn/core/check.h"

namespace limn {
namespace {

// From which samples are placed on the film: of each its own, drawn at once.
std::array<std::array<double, 2>, kMostTogether> film_numbers(
    std::span<const KeyedSample> samples) {
  Rng::Stream streams[kMostTogether];
  for (size_t i = 0; i < samples.size(); ++i) streams[i] = {&samples[i].key, 0};
  std::array<std::array<double, 2>, kMostTogether> numbers;
  Rng::draw(Purpose::kFilm, {streams, samples.size()}, numbers.data());
  return numbers;
}

// Whether any material is worth lanes.
bool is_glossy(const Scene& scene) {
  return std::ranges::any_of(scene.shapes, [](const Shape& shape) {
    const auto is_ggx = [](const Bsdf* side) { return side && side->lobe().model == &ggx_lobe(); };
    return is_ggx(shape.bsdf->side(true)) || is_ggx(shape.bsdf->side(false));
  });
}

}  // namespace

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
  RayCount rays;
  Tracer tracer(traced_.context(), rays);
  tracer.work_wide(glossy_);
  DCHECK_LE(samples.size(), kMostTogether);
  // Step by step for all of them, like the paths themselves (path.h).
  const auto numbers = film_numbers(samples);
  std::array<FilmPosition, kMostTogether> places;
  for (size_t i = 0; i < samples.size(); ++i) {
    const PixelSample& at = samples[i].at;
    places[i] = sample_pixel_filter(scene_.film, filter_, at.x, at.y, numbers[i]);
    if (mirrored) places[i] = mirrored_in_pixel(scene_.film, at.x, at.y, places[i]);
  }
  std::array<CameraRay<double>, kMostTogether> camera_rays;
  if (scene_.camera.has_lens()) {
    std::array<LensPoint, kMostTogether> lenses;
    sample_lenses(scene_.camera, samples, lenses);
    for (size_t i = 0; i < samples.size(); ++i) {
      camera_rays[i] = ray_at(camera_, {places[i], lenses[i]});
    }
  } else {
    find_rays(camera_, {places.data(), samples.size()}, camera_rays);
  }
  std::array<StartRay<double>, kMostTogether> starts;
  for (size_t i = 0; i < samples.size(); ++i) {
    const CameraRay<double>& ray = camera_rays[i];
    renew(starts[i].ray, [&] { return camera_ray(scene_, ray); });
    starts[i].origin = ray.origin;
    starts[i].direction = ray.direction;
  }
  std::vector<typename Tracer::Walk> walks;
  walks.reserve(samples.size());
  for (size_t i = 0; i < samples.size(); ++i) {
    walks.emplace_back(samples[i].key, 0, visitor);
    if (sink.log()) {
      log_camera_ray(*sink.log(), places[i].x, places[i].y, starts[i].origin, starts[i].direction);
    }
  }
  if (visible_) {
    std::vector<FaceRef> faces;
    for (size_t i = 0; i < samples.size(); ++i) {
      faces.push_back(
          visible_->face_at(samples[i].at.x, samples[i].at.y, places[i].x, places[i].y));
    }
    tracer.follow_rays({starts.data(), walks.size()}, faces, walks);
  } else {
    tracer.follow_rays({starts.data(), walks.size()}, walks);
  }
  sink.cost(0).add(rays);
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
