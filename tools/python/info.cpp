// What a scene holds, under the names that `limn info --json` has.
#include <set>

#include "limn/core/bounds.h"
#include "limn/core/parallel.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"
#include "tools/python/bindings.h"

namespace limn::python {

namespace {

nb::dict describe_edges(const EdgeMesh& edges) {
  nb::dict counts;
  counts["smooth"] = edges.count(EdgeClass::kSmooth);
  counts["sharp"] = edges.count(EdgeClass::kSharp);
  counts["border"] = edges.count(EdgeClass::kBoundary);
  counts["irregular"] = edges.count(EdgeClass::kIrregular);
  counts["flat"] = edges.count(EdgeClass::kFlat);
  return counts;
}

nb::dict describe_shape(const Scene& scene, ShapeId id) {
  const Shape& shape = scene.shape(id);
  const EdgeMesh edges = build_edge_mesh(shape.mesh, shape.bsdf->side(false) == nullptr);
  const Bounds bounds = bounds_of(shape.mesh);
  constexpr const char* kNormals[] = {"face", "computed", "from the file"};
  const auto vector = [](const Vec3d& v) { return std::vector<double>{v.x, v.y, v.z}; };
  nb::dict row;
  row["name"] = scene.shape(id).id;
  row["faces"] = shape.mesh.faces.size();
  row["vertices"] = shape.mesh.positions.size();
  row["collapsed_faces"] = shape.mesh.collapsed_faces;
  row["normals"] = kNormals[static_cast<int>(shape.mesh.normal_source)];
  row["bounds"] = std::vector{vector(bounds.lower), vector(bounds.upper)};
  row["edges"] = describe_edges(edges);
  row["closed"] = edges.count(EdgeClass::kBoundary) + edges.count(EdgeClass::kIrregular) == 0;
  row["bsdf"] = shape.bsdf->describe();
  row["emitter"] = shape.is_emitter;
  return row;
}

nb::dict describe_crossings(const Scene& scene, int threads) {
  std::vector<const Mesh*> meshes;
  for (const Shape& shape : scene.shapes) meshes.push_back(&shape.mesh);
  const std::vector<FacePair> pairs = find_face_pairs(meshes, value(scene.camera.origin), threads);
  const std::vector<IntersectionSegment> segments = find_intersections(meshes, pairs, threads);
  std::set<ShapeId> shapes;
  for (const IntersectionSegment& segment : segments) {
    for (const FaceRef face : segment.faces) shapes.insert(face.shape);
  }
  std::vector<std::string> names;
  for (const ShapeId shape : shapes) names.push_back(scene.shape(shape).id);
  nb::dict crossings;
  crossings["segments"] = segments.size();
  crossings["shapes"] = names;
  return crossings;
}

nb::dict info(const SceneHandle& handle, int threads) {
  const Scene& scene = handle.get();
  nb::list shapes, lights, parameters, sensors;
  for (const Sensor& sensor : scene.sensors) sensors.append(sensor.id);
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    shapes.append(describe_shape(scene, ShapeId(i)));
  }
  for (const auto& light : scene.delta_lights) {
    nb::dict row;
    row["name"] = light->id;
    row["light"] = light->describe();
    lights.append(row);
  }
  for (const Parameter& parameter : list_parameters(scene)) {
    nb::dict row;
    row["name"] = parameter.name;
    row["unit"] = parameter.unit;
    row["size"] = parameter.size;
    parameters.append(row);
  }
  nb::dict all;
  all["scene"] = scene.file;
  all["shapes"] = shapes;
  all["lights"] = lights;
  all["sensors"] = sensors;
  all["crossings"] = describe_crossings(scene, thread_count(threads));
  all["parameters"] = parameters;
  return all;
}

}  // namespace

void bind_info(nb::module_& m) {
  m.def("info", info, nb::arg("scene"), nb::arg("threads") = 0,
        nb::sig("def info(scene: Scene, threads: int = 0) -> dict[str, typing.Any]"),
        "What a scene holds: shapes with their edges, lights, where surfaces cross, parameters; as "
        "limn info --json writes it.");
}

}  // namespace limn::python
