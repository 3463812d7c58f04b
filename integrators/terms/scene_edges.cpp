// Edges, light polygons and the environment of a scene, for edge samplers.
#include "integrators/terms/scene_edges.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "limn/core/face_copies.h"
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
  const std::vector<ContactLine> contacts =
      unite_touching_edges(touching_shapes(scene), pairs, pinhole, threads, input.objects);
  const std::vector<CrossingSegment> crossings = find_crossings(meshes, pairs, threads);
  if (!crossings.empty() || !contacts.empty())
    input.objects.push_back(crossing_edges(meshes, crossings, contacts));
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

void warn_of_contacts(const Scene& scene, const EdgeSamplerInput* edges,
                      std::vector<std::string>& warnings) {
  if (!edges || edges->objects.empty() || edges->objects.back().shape.valid()) return;
  const EdgeMesh& lines = edges->objects.back();
  std::set<std::pair<ShapeId, ShapeId>> pairs;
  for (uint32_t e = 0; e < lines.edges.size(); ++e) {
    const FacesAround around = lines.around(EdgeId(e));
    if (around.incidence(0).through) continue;  // they cross
    pairs.insert(std::minmax(around.faces[0].shape, around.faces[1].shape));
  }
  for (const auto& shapes : pairs) {
    const std::string text = fmt::format(
        "{} and {} touch, and one moves towards the other or away from it: the derivative is that "
        "of pressing them together; apart, light comes in between, and the slope is another one "
        "(differences take the mean of both)",
        name_in_text(scene, shapes.first), name_in_text(scene, shapes.second));
    if (std::find(warnings.begin(), warnings.end(), text) == warnings.end())
      warnings.push_back(text);
  }
}

}  // namespace limn
