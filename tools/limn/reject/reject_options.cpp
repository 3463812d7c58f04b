// The options of limn reject.
#include <cmath>

#include "tools/limn/command_reject.h"

namespace limn {
namespace {

// A vector as x,y,z; a direction may have any length but 0.
enum class VectorKind { kPoint, kDirection };
void add_vector(CLI::App& app, const std::string& name, const std::string& text, VectorKind kind,
                const std::function<void(const Vec3d&)>& set) {
  const auto check = [=](const std::vector<double>& v) {
    const Vec3d vector{v[0], v[1], v[2]};
    if (!std::isfinite(length(vector))) throw CLI::ValidationError(name, "must be finite");
    if (kind == VectorKind::kDirection && length(vector) == 0)
      throw CLI::ValidationError(name, "a direction cannot be 0,0,0");
    set(vector);
  };
  app.add_option_function<std::vector<double>>(name, check, text)
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,Z");
}

}  // namespace

void add_reject_options(CLI::App& app, RejectCommand& command) {
  // Those whose rejection differs.
  command.methods = {"forest", "quadric", "quadric:quadrics=off", "li2019"};
  app.add_option("-o,--output", command.output, "Folder for pictures, figures and report")
      ->required()
      ->type_name("FOLDER");
  app.add_option("--methods", command.methods,
                 "Edge samplers to examine; the first one's tree chooses the node")
      ->delimiter(',')
      ->capture_default_str();
  app.add_option("--shape", command.shape,
                 "Id of the shape to examine (default: the shape with the most edges)");
  app.add_option(
         "--node-edges", command.node_edges,
         "Choose a node of about this many edges that is accepted about as often as rejected")
      ->check(within(1, 1 << 30))
      ->capture_default_str();
  app.add_option(
         "--node", command.node,
         "Number of the node to examine in the first method's tree, in place of --node-edges")
      ->check(within(0, 1u << 31));
  app.add_option("--extent", command.extent, "Half-width of the slices, in radii of the mesh")
      ->check(within(1e-3, 1e3))
      ->capture_default_str();
  app.add_option("--distance", command.distance, "Distance of the slices, in radii of the mesh")
      ->check(within(0.0, 1e3))
      ->capture_default_str();
  add_vector(app, "--point", "Shading point whose reachable edges are drawn", VectorKind::kPoint,
             [&](const Vec3d& v) { command.point = v; });
  add_vector(app, "--view", "Direction from the mesh to the camera of that picture",
             VectorKind::kDirection, [&](const Vec3d& v) { command.view = v; });
  add_vector(app, "--up", "Up direction of that picture (default: 0,1,0)", VectorKind::kDirection,
             [&](const Vec3d& v) { command.up = v; });
  app.add_option("--size", command.size, "Width and height of pictures, in pixels")
      ->check(within(16, 8192))
      ->capture_default_str();
  app.add_option(
         "--points", command.points,
         "Points around the mesh from which acceptance rates and counts by depth are measured")
      ->check(within(2, 1 << 24))
      ->capture_default_str();
  app.add_flag_callback(
      "--no-report", [&] { command.report = false; }, "Write no report.html");
}

}  // namespace limn
