#pragma once
// A scene made ready for paths, once for every pass: ray tracer, lights, viewpoints, and light in
// closed form or mirrored light.
#include <memory>

#include "integrators/paths/path_context.h"
#include "limn/core/face_overlaps.h"

namespace limn {

// Whether any BSDF has a GGX lobe, which is evaluated eight at a time (PathTracer::work_wide).
bool is_glossy(const Scene& scene);

// Which light and which share of the directions paths draw, and how they end, as a scene has it
// before it moves. The scene must outlive it.
struct PathChoices {
  explicit PathChoices(const Scene& scene)
      : unmoved(scene),
        lights(scene, nullptr, DrawFaces::kByArea),
        mirrored(MirroredLight::make(scene, lights)) {}
  // The faces that overlap, found once for all scenes whose faces and camera are where the unmoved
  // one's are; null for others. Not for use from several threads at once.
  std::shared_ptr<const CoincidentFaces> faces_of(const Scene& moved, int threads);
  const Scene& unmoved;
  Lights lights;
  std::unique_ptr<MirroredLight> mirrored;

 private:
  std::shared_ptr<const CoincidentFaces> faces_;
};

class TracedScene {
 public:
  struct Options {
    // The light that surfaces scatter is known in closed form: InputError if it is not
    // (closed_light.h).
    bool closed = false;
    // Paths start beside edges.
    bool edges = false;
    // The faces that overlap; null: they are found here.
    std::shared_ptr<const CoincidentFaces> faces = nullptr;
    // Paths are those of differences (PathContext::unmoved).
    bool of_differences = false;
    // Nothing but an image is made of the paths.
    bool image = false;
  };
  // scene: with its parameters seeded; it must outlive this.
  TracedScene(const Scene& scene, int threads, const Options& options);
  // A scene that has moved, traced by the choices of the one that has not (limn/core/lights.h).
  TracedScene(const Scene& moved, PathChoices& choices, int threads);
  TracedScene(const TracedScene&) = delete;
  TracedScene& operator=(const TracedScene&) = delete;

  const PathContext& context() const { return context_; }
  double tracer_seconds() const { return tracer_seconds_; }

 private:
  double tracer_seconds_ = 0;
  std::unique_ptr<RayTracer> tracer_;
  Lights lights_;
  std::unique_ptr<ClosedLight> closed_;      // null where paths are sampled
  std::unique_ptr<Viewpoints> viewpoints_;   // null where none starts beside an edge
  std::unique_ptr<MirroredLight> mirrored_;  // null where nothing mirrors
  std::unique_ptr<const FlatMirrors> flat_mirrors_;
  PathContext context_;
};

}  // namespace limn
