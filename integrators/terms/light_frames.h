#pragma once
// The borders of framed lights (framed_light.h) as edges just in front of them, across which light
// ends. Rays do not meet them; they are sampled like the edges of hard shadows.
#include <optional>

#include "limn/core/framed_light.h"
#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

class LightFrames {
 public:
  // edges: of the scene. Both must outlive it.
  LightFrames(const Scene& scene, const EdgeSamplerInput& edges);

  // The edges, and where a light has a frame, an object more for each light of the scene: four
  // edges, or none, whose vertices are the corners.
  const EdgeSamplerInput& edges() const { return all_ ? *all_ : edges_; }
  // The number of the light whose frame an object of edges() is; none for others.
  std::optional<uint32_t> light_of(ShapeId object) const {
    const size_t first = edges_.objects.size();
    if (object.index() < first) return {};
    return static_cast<uint32_t>(object.index() - first);
  }

 private:
  const EdgeSamplerInput& edges_;
  std::optional<EdgeSamplerInput> all_;
};

// The light whose frame an object is; null for others. edges: of the scene, without frames.
const FramedLight* light_of_frame(const Scene& scene, const EdgeSamplerInput& edges,
                                  ShapeId object);

}  // namespace limn
