// What paths need of a scene, in the order in which one part needs the other.
#include "integrators/paths/traced_scene.h"

#include <algorithm>

#include "integrators/paths/straight_way.h"
#include "limn/core/exposure.h"
#include "limn/core/mis_compensation.h"

namespace limn {

bool is_glossy(const Scene& scene) {
  return std::ranges::any_of(scene.shapes, [](const Shape& shape) {
    const auto is_ggx = [](const Bsdf* side) { return side && side->lobe().model == &ggx_lobe(); };
    return is_ggx(shape.bsdf->side(true)) || is_ggx(shape.bsdf->side(false));
  });
}

TracedScene::TracedScene(const Scene& scene, int threads, const Options& options)
    : tracer_([&] {
        const Stopwatch watch;
        auto tracer = make_embree_tracer(scene, threads, options.faces);
        tracer_seconds_ = watch.seconds();
        return tracer;
      }()),
      lights_(scene, nullptr, options.of_differences ? DrawFaces::kByArea : DrawFaces::kByLight,
              options.image ? mis_compensated(scene.environment) : nullptr),
      closed_(options.closed ? std::make_unique<ClosedLight>(scene, threads) : nullptr),
      viewpoints_(options.edges ? std::make_unique<Viewpoints>(scene) : nullptr),
      mirrored_(options.closed
                    ? nullptr
                    : MirroredLight::make(scene, lights_,
                                          options.image ? MirroredLight::Use::kImage
                                                        : MirroredLight::Use::kDerivatives)),
      flat_mirrors_(options.edges && find_smooth(scene) ? FlatMirrors::make(scene) : nullptr),
      context_{scene,
               *tracer_,
               lights_,
               closed_.get(),
               viewpoints_.get(),
               mirrored_.get(),
               options.of_differences ? &scene : nullptr,
               flat_mirrors_.get(),
               options.edges && has_straight_ways(scene)} {}

std::shared_ptr<const CoincidentFaces> PathChoices::faces_of(const Scene& moved, int threads) {
  if (moved.exposure && moved.exposure->no_overlaps) return nullptr;  // the tracer's own
  const auto same = [](const Shape& a, const Shape& b) {
    return a.mesh.positions == b.mesh.positions;
  };
  if (value(moved.camera.origin) != value(unmoved.camera.origin) ||
      !std::ranges::equal(moved.shapes, unmoved.shapes, same))
    return nullptr;
  if (!faces_) faces_ = std::make_shared<CoincidentFaces>(unmoved, threads);
  return faces_;
}

TracedScene::TracedScene(const Scene& moved, PathChoices& choices, int threads)
    : tracer_(make_embree_tracer(moved, threads, choices.faces_of(moved, threads))),
      lights_(moved, &choices.lights),
      context_{moved,           *tracer_, lights_, nullptr, nullptr, choices.mirrored.get(),
               &choices.unmoved} {}

}  // namespace limn
