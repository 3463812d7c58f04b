// Faces of a pixel, each with the light at its centroid.
#include "integrators/methods/faces_estimator.h"

#include <algorithm>

#include "integrators/paths/camera_path.h"
#include "integrators/paths/path_follow.h"
#include "integrators/paths/path_log.h"

namespace limn {

void check_faces_film(const Film& film) { PixelRegions::check(film, kFacesUser); }

struct FacesEstimator::Group {
  Group(const Scene& of, std::span<const Parameter> parameters, int threads,
        const RayTracer& tracer, const Lights& lights)
      : scene(deep_copy(of)) {
    for (size_t k = 0; k < parameters.size(); ++k) {
      parameters[k].seed(scene, static_cast<int>(k));
    }
    closed = std::make_unique<ClosedLight>(scene, threads);
    view = std::make_unique<CameraView<Dual>>(scene.camera);
    context.reset(new PathContext{scene, tracer, lights, closed.get()});
  }
  Scene scene;
  std::unique_ptr<ClosedLight> closed;
  std::unique_ptr<CameraView<Dual>> view;
  std::unique_ptr<PathContext> context;
};

FacesEstimator::FacesEstimator(const Scene& scene, std::span<const Parameter> parameters,
                               int threads)
    : scene_((check_faces_film(scene.film), scene)),
      lanes_(static_cast<int>(std::min<size_t>(parameters.size(), kLanes))),
      faces_(std::make_shared<FacesInPlace>(scene, threads)),
      pixels_(scene, *faces_, threads, kFacesUser),
      tracer_(make_embree_tracer(scene, threads, faces_)),
      lights_(scene),
      view_(scene.camera) {
  for (size_t k = 0; k < parameters.size(); k += kLanes) {
    const auto some = parameters.subspan(k).first(std::min<size_t>(kLanes, parameters.size() - k));
    groups_.push_back(std::make_unique<Group>(scene, some, threads, *tracer_, lights_));
  }
  for (int k = 0; k < lanes_; ++k) lane_scale_[k] = parameters[k].natural_step;
  if (groups_.empty()) closed_ = std::make_unique<ClosedLight>(scene, threads);
}

FacesEstimator::~FacesEstimator() = default;

// What faces show of themselves, times what light they send: of one pixel.
template <class S>
void FacesEstimator::add_parts(const PixelParts& parts, const Scene& scene,
                               const CameraView<S>& view, const PathContext& context, size_t slot,
                               const KeyedSample& sample, SampleSink& sink) const {
  using Tracer = PathTracer<S, NoVisitor>;
  RayCount rays;
  Tracer tracer(context, rays);
  Rgb<S> sum;
  bool finite = true;
  for (size_t first = 0; first < parts.size(); first += Tracer::kMostWalks) {
    const size_t count = std::min(parts.size() - first, Tracer::kMostWalks);
    std::array<StartRay<S>, Tracer::kMostWalks> starts;
    std::array<FaceRef, Tracer::kMostWalks> faces;
    std::array<S, Tracer::kMostWalks> areas;
    std::vector<typename Tracer::Walk> walks;
    for (size_t i = 0; i < count; ++i) {
      const FacePart<S> part = parts.part(first + i, scene, view);
      const CameraRay<S> ray = view.ray(part.x, part.y);
      if (sink.log()) {
        log_camera_ray(*sink.log(), value(part.x), value(part.y), value(ray.origin),
                       value(ray.direction));
      }
      starts[i].origin = ray.origin;
      starts[i].direction = ray.direction;
      faces[i] = part.face;
      areas[i] = part.area;
      walks.emplace_back(sample.key, 0, nullptr);
    }
    tracer.follow_rays({starts.data(), count}, {faces.data(), count}, walks);
    for (size_t i = 0; i < count; ++i) {
      finite = finite && !walks[i].failed;
      sum += walks[i].sums.radiance * areas[i];
    }
  }
  finite = finite && is_finite(value(sum));
  Rgb<Lanes> derivative;
  if constexpr (std::is_same_v<S, Dual>) {
    derivative = {sum.r.d, sum.g.d, sum.b.d};
    finite = finite && is_finite(derivative);
  }
  sink.cost(slot).samples += parts.size();
  if (!finite) {
    sink.reject(sample.at, kFacesTerm);
    return;
  }
  if (slot == 0) sink.add_radiance(sample.at, value(sum), 1);
  if (lanes_ > 0) sink.add(slot, sample.at, derivative, 1);
}

void FacesEstimator::add_pixels(std::span<const KeyedSample> samples, SampleSink& sink) const {
  if (samples.empty()) return;
  const size_t t = pixels_.tile_of(samples[0].at.x, samples[0].at.y);
  const Tile& tile = pixels_.tiles()[t];
  const auto place = [&](int x, int y) {
    return static_cast<size_t>(y - tile.y0) * (tile.x1 - tile.x0) + (x - tile.x0);
  };
  std::vector<std::vector<const KeyedSample*>> of_pixel(static_cast<size_t>(tile.x1 - tile.x0) *
                                                        (tile.y1 - tile.y0));
  for (const KeyedSample& sample : samples) {
    of_pixel[place(sample.at.x, sample.at.y)].push_back(&sample);
  }
  PixelParts parts(scene_, pixels_);
  pixels_.for_each_pixel(
      t, nullptr, [&](int x, int y) { return !of_pixel[place(x, y)].empty(); },
      [&](int x, int y, const VisibleRegions& regions) {
        parts.find(x, y, regions, !groups_.empty());
        for (const KeyedSample* sample : of_pixel[place(x, y)]) {
          if (groups_.empty()) {
            const PathContext context{scene_, *tracer_, lights_, closed_.get()};
            add_parts(parts, scene_, view_, context, 0, *sample, sink);
          }
          for (size_t g = 0; g < groups_.size(); ++g) {
            const Group& group = *groups_[g];
            add_parts(parts, group.scene, *group.view, *group.context, g, *sample, sink);
          }
        }
      });
}

}  // namespace limn
