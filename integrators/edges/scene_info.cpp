// Shapes with their edges, lights, sensors, where surfaces cross, parameters.
#include "limn/integrators/scene_info.h"

#include <nlohmann/json.hpp>
#include <set>

#include "limn/core/parameter.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"

namespace limn {
namespace {

using nlohmann::json;

json describe_shape(const Scene& scene, ShapeId id) {
  const Shape& shape = scene.shape(id);
  const EdgeMesh edges = build_edge_mesh(shape.mesh, shape.bsdf->side(false) == nullptr);
  const Bounds bounds = bounds_of(shape.mesh);
  constexpr const char* kNormals[] = {"face", "computed", "from the file"};
  const auto vector = [](const Vec3d& v) { return json::array({v.x, v.y, v.z}); };
  return {{"name", shape.id},
          {"faces", shape.mesh.faces.size()},
          {"vertices", shape.mesh.positions.size()},
          {"collapsed_faces", shape.mesh.collapsed_faces},
          {"normals", kNormals[static_cast<int>(shape.mesh.normal_source)]},
          {"bounds", {vector(bounds.lower), vector(bounds.upper)}},
          {"edges",
           {{"smooth", edges.count(EdgeClass::kSmooth)},
            {"sharp", edges.count(EdgeClass::kSharp)},
            {"border", edges.count(EdgeClass::kBoundary)},
            {"irregular", edges.count(EdgeClass::kIrregular)},
            {"flat", edges.count(EdgeClass::kFlat)}}},
          {"closed", edges.count(EdgeClass::kBoundary) + edges.count(EdgeClass::kIrregular) == 0},
          {"bsdf", shape.bsdf->describe()},
          {"emitter", shape.is_emitter}};
}

json describe_crossings(const Scene& scene, int threads) {
  std::vector<const Mesh*> meshes;
  for (const Shape& shape : scene.shapes) meshes.push_back(&shape.mesh);
  const std::vector<FacePair> pairs = find_face_pairs(meshes, value(scene.camera.origin), threads);
  const std::vector<IntersectionSegment> segments = find_intersections(meshes, pairs, threads);
  std::set<ShapeId> shapes;
  for (const IntersectionSegment& segment : segments)
    for (const FaceRef face : segment.faces) shapes.insert(face.shape);
  json names = json::array();
  for (const ShapeId shape : shapes) names.push_back(scene.shape(shape).id);
  return {{"segments", segments.size()}, {"shapes", names}};
}

}  // namespace

std::string scene_info(const Scene& scene, int threads) {
  json info = {{"scene", scene.file},
               {"shapes", json::array()},
               {"lights", json::array()},
               {"sensors", json::array()},
               {"crossings", describe_crossings(scene, threads)},
               {"parameters", json::array()}};
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    info["shapes"].push_back(describe_shape(scene, ShapeId(i)));
  }
  for (const auto& light : scene.delta_lights) {
    info["lights"].push_back({{"name", light->id}, {"light", light->describe()}});
  }
  for (const Sensor& sensor : scene.sensors) info["sensors"].push_back(sensor.id);
  for (const Parameter& parameter : list_parameters(scene)) {
    info["parameters"].push_back(
        {{"name", parameter.name}, {"unit", parameter.unit}, {"size", parameter.size}});
  }
  return info.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace limn
