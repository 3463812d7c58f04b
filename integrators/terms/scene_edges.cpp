// Edges, light polygons and the environment of a scene, for edge samplers.
#include "integrators/terms/scene_edges.h"

#include <algorithm>

#include "limn/core/lights.h"
#include "limn/edgetree/crossing_curves.h"

namespace limn {

EdgeSamplerInput make_sampler_input(const Scene& scene, int threads) {
  EdgeSamplerInput input;
  std::vector<const Mesh*> meshes;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const bool black_behind = shape.bsdf->side(false) == nullptr;
    input.objects.push_back(build_edge_mesh(shape.mesh, black_behind, ShapeId(s)));
    meshes.push_back(&shape.mesh);
  }
  const std::vector<CrossingSegment> crossings = find_crossings(meshes, threads);
  if (!crossings.empty()) input.objects.push_back(crossing_edges(meshes, crossings));
  const Lights lights(scene);
  for (const Light* light : lights.all()) light->add_triangles(input.lights);
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
