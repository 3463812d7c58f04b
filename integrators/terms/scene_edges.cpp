// Edges, light polygons and the environment of a scene, for edge samplers.
#include "integrators/terms/scene_edges.h"

#include <algorithm>

#include "limn/core/shading.h"

namespace limn {

EdgeSamplerInput make_sampler_input(const Scene& scene) {
  EdgeSamplerInput input;
  for (const Shape& shape : scene.shapes) {
    const bool black_behind = shape.bsdf->side(false) == nullptr;
    input.objects.push_back(build_edge_mesh(shape.mesh, black_behind));
    if (!shape.is_emitter) continue;
    for (uint32_t f = 0; f < shape.mesh.faces.size(); ++f) {
      const auto corners = face_corners<double>(shape.mesh, f);
      input.lights.push_back(
          {{corners[0], corners[1], corners[2]}, luminance(value(shape.radiance))});
    }
  }
  if (!scene.environment) return input;
  const Environment& environment = *scene.environment;
  input.environment_luminance = environment.mean_luminance();
  if (!environment.is_uniform()) {
    const auto brightness = [&](const Vec3d& d) {
      return std::max(0.0, luminance(environment.radiance(d)));
    };
    input.environment = std::make_shared<RadiancePyramid>(brightness, 8, 2);
  }
  return input;
}

}  // namespace limn
