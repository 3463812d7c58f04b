// `limn info`: what a scene holds, and what can be differentiated.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "limn/core/parallel.h"
#include "limn/core/parameter.h"
#include "limn/integrators/scene_info.h"
#include "tools/limn/command_support.h"
#include "tools/limn/commands.h"

namespace limn {
namespace {

using nlohmann::json;

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
  json info = json::parse(scene_info(scene, thread_count(common.run.threads)));
  for (const json& shape : info["shapes"]) print_shape(shape);
  fmt::print("environment: {}\n",
             scene.environment ? scene.environment->describe() : std::string("none"));
  for (const auto& light : scene.delta_lights) {
    fmt::print("light {}: {}\n", light->id, light->describe());
  }
  print_crossings(info["crossings"]);
  fmt::print("parameters (for --wrt):\n");
  for (const Parameter& parameter : list_parameters(scene)) print_parameter(parameter);
  info["warnings"] = warnings.lines();
  write_json(common.json, info.dump(2));
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
