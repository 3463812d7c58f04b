// `limn info`: what a scene holds, and what can be differentiated.
#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "limn/core/parallel.h"
#include "limn/core/parameter.h"
#include "limn/edgetree/crossing_curves.h"
#include "limn/edgetree/edges.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"

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

void print_shape(const json& shape) {
  const json& edges = shape["edges"];
  fmt::print("  {}: {} faces, {} vertices, {}, {} normals, {}{}\n",
             shape["name"].get<std::string>(), shape["faces"].get<size_t>(),
             shape["vertices"].get<size_t>(), shape["closed"].get<bool>() ? "closed" : "open",
             shape["normals"].get<std::string>(), shape["bsdf"].get<std::string>(),
             shape["emitter"].get<bool>() ? ", emits light" : "");
  fmt::print("    edges: {} smooth, {} sharp, {} border, {} irregular, {} flat\n",
             edges["smooth"].get<size_t>(), edges["sharp"].get<size_t>(),
             edges["border"].get<size_t>(), edges["irregular"].get<size_t>(),
             edges["flat"].get<size_t>());
  const size_t collapsed = shape["collapsed_faces"];
  if (collapsed > 0) fmt::print("    {} faces with coinciding corners left out\n", collapsed);
}

void print_camera(const Scene& scene) {
  const Camera& camera = scene.camera;
  const Film& film = scene.film;
  std::string lens = camera.is_orthographic()
                         ? fmt::format("orthographic, {:.6g} wide", 2 * camera.half_width)
                         : fmt::format("fov {:.6g} degrees", camera.fov.v);
  if (camera.has_lens()) {
    lens += fmt::format(", lens of radius {:.6g} focused at {:.6g}", camera.aperture_radius.v,
                        camera.focus_distance.v);
  }
  fmt::print("camera: at ({:.6g}, {:.6g}, {:.6g}), {}, film {} x {}", camera.origin.x.v,
             camera.origin.y.v, camera.origin.z.v, lens, camera.width, camera.height);
  if (film.crop_width != camera.width || film.crop_height != camera.height) {
    fmt::print(", crop {} x {} at ({}, {})", film.crop_width, film.crop_height, film.crop_x,
               film.crop_y);
  }
  fmt::print("\nintegrator: max_depth {}, rr_depth {}{}\n", scene.max_depth, scene.rr_depth,
             scene.hide_emitters ? ", emitters hidden" : "");
}

// An array is listed once, with the number of its numbers.
void print_parameter(const Parameter& parameter) {
  std::string parts = parameter.colour ? "  all channels alike; one of them: add .r, .g or .b" : "";
  if (parameter.array.size() == 1) {
    parts = fmt::format("  {} numbers: one of them: add .0, .1, ...", parameter.size);
  } else if (parameter.size > 1) {
    parts = fmt::format("  {} numbers: add :FILE, or {}", parameter.size,
                        parameter.array.size() == 3 ? ".0.0.r, .0.0.g, ..." : ".0.x, .0.y, ...");
  }
  fmt::print("  {}  [{}]{}\n", parameter.name, parameter.unit, parts);
}

json describe_crossings(const Scene& scene, std::span<const Mesh* const> meshes,
                        std::span<const FacePair> pairs, int threads) {
  const std::vector<IntersectionSegment> segments = find_intersections(meshes, pairs, threads);
  std::set<ShapeId> shapes;
  for (const IntersectionSegment& segment : segments)
    for (const FaceRef face : segment.faces) shapes.insert(face.shape);
  json names = json::array();
  for (const ShapeId shape : shapes) names.push_back(scene.shape(shape).id);
  return {{"segments", segments.size()}, {"shapes", names}};
}

void print_crossings(const json& crossings) {
  const size_t segments = crossings["segments"];
  if (segments == 0) return;
  fmt::print("surfaces cross along {} segments, which are edges too; shapes involved: {}\n",
             segments, fmt::join(crossings["shapes"].get<std::vector<std::string>>(), ", "));
}

int run_info(const CommonOptions& common) {
  Warnings warnings;
  const Scene scene = load_scene(common, warnings);
  print_camera(scene);
  if (scene.sensors.size() > 1) fmt::print("sensors (for --sensor): {}\n", sensor_names(scene));
  fmt::print("shapes: {}\n", scene.shapes.size());
  json report = {{"scene", scene.file},
                 {"shapes", json::array()},
                 {"lights", json::array()},
                 {"parameters", json::array()},
                 {"sensors", json::array()}};
  for (const Sensor& sensor : scene.sensors) report["sensors"].push_back(sensor.id);
  for (uint32_t i = 0; i < scene.shapes.size(); ++i) {
    report["shapes"].push_back(describe_shape(scene, ShapeId(i)));
    print_shape(report["shapes"].back());
  }
  fmt::print("environment: {}\n",
             scene.environment ? scene.environment->describe() : std::string("none"));
  for (const auto& light : scene.delta_lights) {
    report["lights"].push_back({{"name", light->id}, {"light", light->describe()}});
    fmt::print("light {}: {}\n", light->id, light->describe());
  }
  std::vector<const Mesh*> meshes;
  for (const Shape& shape : scene.shapes) meshes.push_back(&shape.mesh);
  const int threads = thread_count(common.run.threads);
  const std::vector<FacePair> pairs = find_face_pairs(meshes, value(scene.camera.origin), threads);
  report["crossings"] = describe_crossings(scene, meshes, pairs, threads);
  print_crossings(report["crossings"]);
  fmt::print("parameters (for --wrt):\n");
  for (const Parameter& parameter : list_parameters(scene)) {
    report["parameters"].push_back(
        {{"name", parameter.name}, {"unit", parameter.unit}, {"size", parameter.size}});
    print_parameter(parameter);
  }
  report["warnings"] = warnings.lines();
  write_json(common.json, report.dump(2));
  return kSuccess;
}

class InfoCommand final : public Command {
 public:
  const char* name() const override { return "info"; }
  const char* description() const override {
    return "Describe a scene and list the parameters that can be differentiated";
  }
  void add_options(CLI::App& app) override { add_common_options(app, common_); }
  int run(const std::string&) override { return run_info(common_); }

 private:
  CommonOptions common_;
};

}  // namespace

std::unique_ptr<Command> make_info_command() { return std::make_unique<InfoCommand>(); }

}  // namespace limn
