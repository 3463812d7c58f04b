// Edges, light polygons and the environment of a scene, for edge samplers.
#include "integrators/terms/scene_edges.h"

#include <algorithm>
#include <map>

#include "limn/core/lights.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/touching.h"

namespace limn {

namespace {

// Shapes look alike if they share a BSDF; every emitter looks like itself alone.
std::vector<TouchingShape> touching_shapes(const Scene& scene) {
  std::vector<TouchingShape> shapes;
  std::map<const Bsdf*, uint32_t> first_of_bsdf;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const uint32_t look =
        shape.is_emitter ? s : first_of_bsdf.emplace(shape.bsdf.get(), s).first->second;
    shapes.push_back({&shape.mesh, look});
  }
  return shapes;
}

}  // namespace

EdgeSamplerInput make_sampler_input(const Scene& scene, int threads) {
  EdgeSamplerInput input;
  std::vector<const Mesh*> meshes;
  for (uint32_t s = 0; s < scene.shapes.size(); ++s) {
    const Shape& shape = scene.shapes[s];
    const bool black_behind = shape.bsdf->side(false) == nullptr;
    input.objects.push_back(build_edge_mesh(shape.mesh, black_behind, ShapeId(s)));
    meshes.push_back(&shape.mesh);
  }
  const Vec3d pinhole = value(scene.camera.origin);
  const std::vector<FacePair> pairs = find_face_pairs(meshes, pinhole, threads);
  unite_touching_edges(touching_shapes(scene), pairs, pinhole, threads, input.objects);
  const std::vector<CrossingSegment> crossings = find_crossings(meshes, pairs, threads);
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
