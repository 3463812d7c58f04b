#pragma once
// A scene made ready for paths among blurred faces.
#include <memory>
#include <vector>

#include "limn/core/blur_tracer.h"
#include "limn/core/lights.h"

namespace limn {

// InputError, with the place, for what blurred faces do not have: interpolated normals, textured
// emitters, textures with discontinuities, light that passes surfaces straight on.
void check_blurred(const Scene& scene);

// A scene whose emitters are as large as they are blurred, for light sampling: the opacity of what
// is drawn is a factor of its light.
class BlurredEmitters {
 public:
  BlurredEmitters(const Scene& scene, const Blur& blur);
  const Scene& scene() const { return scene_; }
  // The face of the original scene that a face of scene() is part of.
  FaceRef face(FaceRef piece) const {
    return {piece.shape, FaceId(faces_[piece.shape.index()][piece.face.index()])};
  }

 private:
  Scene scene_;
  std::vector<std::vector<uint32_t>> faces_;  // of each shape
};

class BlurredScene {
 public:
  // scene: with its parameters seeded; it must outlive this. blur: see resolved(). unmoved: of
  // differences, the scene before it moved, by which lights are chosen and paths end; it must
  // outlive this; null: the scene itself.
  BlurredScene(const Scene& scene, const Blur& blur, int threads,
               const BlurredScene* unmoved = nullptr);
  BlurredScene(const BlurredScene&) = delete;
  BlurredScene& operator=(const BlurredScene&) = delete;

  const Scene& scene() const { return faces_.scene(); }
  const Scene& unmoved() const { return unmoved_; }
  const Blur& blur() const { return faces_.blur(); }
  const BlurFaces& faces() const { return faces_; }
  const BlurTracer& tracer() const { return *tracer_; }
  const BlurredEmitters& emitters() const { return emitters_; }
  const Lights& lights() const { return lights_; }  // of emitters()
  // Depth of the background of kPublished: the scene's far end, from the camera or from within.
  double far(int bounces) const { return bounces == 0 ? far_ : size_; }

 private:
  const Scene& unmoved_;
  BlurFaces faces_;
  std::unique_ptr<BlurTracer> tracer_;
  BlurredEmitters emitters_;
  Lights lights_;
  double size_, far_;
};

}  // namespace limn
