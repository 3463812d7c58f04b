// Faces of a pixel, each with the light at its centroid.
#include "integrators/methods/faces_estimator.h"

#include <fmt/format.h>

#include <algorithm>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"
#include "limn/core/exposure.h"

namespace limn {

struct FacesEstimator::Group {
  // all: the scene without the group's tangents.
  Group(const PathContext& all, std::span<const Parameter> parameters)
      : scene(deep_copy(all.scene)) {
    for (size_t k = 0; k < parameters.size(); ++k) {
      parameters[k].seed(scene, static_cast<int>(k));
    }
    closed = std::make_unique<ClosedLight>(scene, *all.closed);
    view = std::make_unique<CameraView<Dual>>(scene.camera);
    context.reset(new PathContext{scene, all.tracer, all.lights, closed.get()});
  }
  Scene scene;
  std::unique_ptr<ClosedLight> closed;
  std::unique_ptr<CameraView<Dual>> view;
  std::unique_ptr<PathContext> context;
};

FacesEstimator::FacesEstimator(const Scene& scene, std::span<const Parameter> parameters,
                               int threads)
    : scene_((check_still(scene, kRegionsUser, parameters), PixelRegions::check(scene), scene)),
      lanes_(static_cast<int>(std::min<size_t>(parameters.size(), kLanes))),
      faces_(std::make_shared<CoincidentFaces>(scene, threads)),
      pixels_(scene, *faces_, threads),
      traced_(scene, threads, {.closed = true, .faces = faces_}),
      view_(scene.camera) {
  for (size_t k = 0; k < parameters.size(); k += kLanes) {
    const auto some = parameters.subspan(k).first(std::min<size_t>(kLanes, parameters.size() - k));
    groups_.push_back(std::make_unique<Group>(traced_.context(), some));
  }
  for (int k = 0; k < lanes_; ++k) lane_scale_[k] = parameters[k].natural_step;
}

FacesEstimator::~FacesEstimator() = default;

// Adds what a face shows of itself, times the light that it sends; false if that is not finite.
template <class S>
bool FacesEstimator::add_part(const PixelParts& parts, size_t i, const Scene& scene,
                              const CameraView<S>& view, const PathContext& context, SampleLog* log,
                              Rgb<S>& sum) const {
  const FacePart<S> part = parts.part(i, scene, view);
  const CameraRay<S> ray = view.ray(part.x, part.y);
  if (log) {
    log->push_back(fmt::format("area {:.6g} pixels", value(part.area)));
    log_camera_ray(*log, value(part.x), value(part.y), value(ray.origin), value(ray.direction));
  }
  RayCount rays;
  PathTracer<S, NoVisitor> tracer(context, rays);
  Walk<S, NoVisitor> walk(Rng(0, 0, 0), 0, nullptr);
  if (part.face.shape.valid()) {
    const auto surface = surface_on_ray<S>(context.scene, part.face, ray.origin, ray.direction);
    tracer.place(walk, surface, -ray.direction);
    tracer.follow_one(walk);
  } else {
    walk.sums.radiance = tracer.escaped(ray.direction, 0);
  }
  sum += walk.sums.radiance * part.area;
  return !walk.failed;
}

bool FacesEstimator::add_image(const PixelParts& parts, const PixelSample& at,
                               SampleSink& sink) const {
  Rgb<double> sum;
  for (size_t i = 0; i < parts.size(); ++i) {
    if (!add_part(parts, i, scene_, view_, traced_.context(), sink.log(), sum)) return false;
  }
  if (!is_finite(sum)) return false;
  sink.add_radiance(at, sum, 1);
  return true;
}

// Face by face: what one group has found of the light there the next one takes.
bool FacesEstimator::add_derivatives(const PixelParts& parts, const PixelSample& at,
                                     SampleSink& sink) const {
  std::vector<Rgb<Dual>> sums(groups_.size());
  for (size_t i = 0; i < parts.size(); ++i) {
    for (size_t g = 0; g < groups_.size(); ++g) {
      const Group& group = *groups_[g];
      SampleLog* log = g == 0 ? sink.log() : nullptr;
      if (!add_part(parts, i, group.scene, *group.view, *group.context, log, sums[g])) return false;
    }
  }
  const auto derivative = [](const Rgb<Dual>& sum) {
    return Rgb<Lanes>{sum.r.d, sum.g.d, sum.b.d};
  };
  for (const Rgb<Dual>& sum : sums) {
    if (!is_finite(value(sum)) || !is_finite(derivative(sum))) return false;
  }
  sink.add_radiance(at, value(sums[0]), 1);
  for (size_t g = 0; g < groups_.size(); ++g) sink.add(g, at, derivative(sums[g]), 1);
  return true;
}

void FacesEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  if (samples.empty()) return;
  const size_t t = pixels_.tile_of(samples[0].at.x, samples[0].at.y);
  const Tile& tile = pixels_.tiles()[t];
  const auto place = [&](int x, int y) {
    return static_cast<size_t>(y - tile.y0) * (tile.x1 - tile.x0) + (x - tile.x0);
  };
  std::vector<const PixelSample*> of_pixel(static_cast<size_t>(tile.x1 - tile.x0) *
                                           (tile.y1 - tile.y0));
  for (const KeyedSample& sample : samples) {
    of_pixel[place(sample.at.x, sample.at.y)] = &sample.at;
  }
  PixelParts parts(scene_, pixels_);
  pixels_.for_each_pixel(
      t, nullptr, [&](int x, int y) { return of_pixel[place(x, y)] != nullptr; },
      [&](int x, int y, const VisibleRegions& regions) {
        const PixelSample& at = *of_pixel[place(x, y)];
        parts.find(x, y, regions, !groups_.empty());
        sink.cost(0).samples += parts.size();
        const bool finite =
            groups_.empty() ? add_image(parts, at, sink) : add_derivatives(parts, at, sink);
        if (!finite) sink.reject(at, kFacesTerm);
      });
}

}  // namespace limn
