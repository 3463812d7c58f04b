// Images of blurred faces, see blurred_path.h.
#include "integrators/methods/blurred_estimator.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "integrators/paths/blurred_path.h"
#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_log.h"
#include "limn/core/error.h"
#include "limn/core/exposure.h"

namespace limn {
namespace {

// As they move, pixels gain and lose particles by the slope of their filters.
void check_moving_particles(const Scene& scene) {
  const Film& film = scene.film;
  if (film.filter.kind != Filter::Kind::kBox && film.sample_border) return;
  throw InputError(film.where,
                   "derivatives by particles need a filter that ends nowhere at once: any but "
                   "box, with sample_border");
}

std::shared_ptr<const Scene> seeded(const Scene& scene, std::span<const BlurredNumber> derived,
                                    const std::optional<double>& time) {
  if (derived.empty() && !time) return {std::shared_ptr<const Scene>(), &scene};
  auto copy = std::make_shared<Scene>(deep_copy(scene));
  for (size_t k = 0; k < derived.size(); ++k) {
    derived[k].parameter.seed(*copy, static_cast<int>(k), derived[k].component);
  }
  if (time) set_time(*copy, *time);
  return copy;
}

}  // namespace

BlurredEstimator::BlurredEstimator(const Scene& scene, const Blur& blur,
                                   std::span<const BlurredNumber> derived, int threads,
                                   Numbers numbers, std::optional<double> time)
    : scene_((check_blurred(scene), seeded(scene, derived, time))),
      lanes_(static_cast<int>(derived.size())),
      blurred_(*scene_, blur, threads),
      particles_(blurred_),
      filter_(scene_->film.filter),
      numbers_(numbers) {
  if (lanes_ > 0 && !particles_.empty()) check_moving_particles(scene);
  for (int k = 0; k < lanes_; ++k) lane_scale_[k] = derived[k].parameter.natural_step;
}

BlurredEstimator::BlurredEstimator(const Scene& moved, const BlurredScene& unmoved, int threads,
                                   Numbers numbers)
    : scene_(std::shared_ptr<const Scene>(), &moved),
      blurred_(moved, unmoved.blur(), threads, &unmoved),
      particles_(blurred_),
      filter_(scene_->film.filter),
      numbers_(numbers) {}

template <class S>
void BlurredEstimator::add(const KeyedSample& sample, const CameraView<S>& view,
                           SampleSink& sink) const {
  const PixelSample& at = sample.at;
  const FilmPosition place = sample_pixel_filter(scene_->film, filter_, at.x, at.y, sample.key);
  const CameraRay<S> camera = sample_ray(view, place, sample.key);
  if (sink.log()) {
    log_camera_ray(*sink.log(), place.x, place.y, value(camera.origin), value(camera.direction));
  }
  RayCount rays;
  BlurredPath<S> path(blurred_, sample.key, lane_scale_, rays);
  Rgb<S> radiance;
  bool traced = true;
  try {
    radiance = path.arriving({camera.origin, camera.direction, camera.t_min, camera.t_max});
  } catch (const UntraceableRay&) {
    traced = false;
  }
  sink.cost(0).add(rays);
  ++sink.cost(0).samples;
  const double weight = pixel_filter_weight(scene_->film, filter_, at.x, at.y, place);
  if (!traced || !is_finite(value(radiance))) return sink.reject(at, slot_name(0));
  if constexpr (std::is_same_v<S, Dual>) {
    const Rgb<Lanes> derivative{radiance.r.d, radiance.g.d, radiance.b.d};
    if (!is_finite(derivative)) return sink.reject(at, slot_name(0));
    sink.add(0, at, derivative, weight);
  }
  sink.add_radiance(at, value(radiance), weight);
}

void BlurredEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  if (lanes_ > 0) {
    const CameraView<Dual> view(scene_->camera);
    for (const KeyedSample& sample : samples) add(sample, view, sink);
  } else {
    const CameraView<double> view(scene_->camera);
    for (const KeyedSample& sample : samples) add(sample, view, sink);
  }
}

bool BlurredEstimator::sample_film(size_t, double u, const Rng& key, RayCount& rays,
                                   FilmSample& sample) const {
  try {
    return lanes_ > 0 ? particles_.follow<Dual>(u, key, rays, sample)
                      : particles_.follow<double>(u, key, rays, sample);
  } catch (const UntraceableRay&) {
    sample.radiance.r = std::numeric_limits<double>::quiet_NaN();
    return true;
  }
}

std::vector<std::unique_ptr<SampleEstimator>> blurred_passes(const Scene& scene, const Blur& blur,
                                                             std::span<const BlurredNumber> derived,
                                                             int threads,
                                                             std::optional<double> time) {
  std::vector<std::unique_ptr<SampleEstimator>> passes;
  for (size_t k = 0; k < derived.size(); k += kLanes) {
    const auto some = derived.subspan(k).first(std::min<size_t>(kLanes, derived.size() - k));
    passes.push_back(std::make_unique<BlurredEstimator>(scene, blur, some, threads,
                                                        Numbers::kIndependent, time));
  }
  return passes;
}

std::string bias_of_blur(const Scene& scene, const Blur& blur) {
  std::string text = fmt::format(
      "faces fade over {:.3g} scene units (sigma {:.3g}): images and derivatives are those of the "
      "blurred scene, biased for the sharp one",
      std::sqrt(blur.sigma), blur.sigma);
  const double side = median_side(scene);
  if (blur.reach() > side) {
    text += fmt::format("; faces extend by {:.3g}, more than the median of their sides, {:.3g}",
                        blur.reach(), side);
  }
  return text;
}

}  // namespace limn
