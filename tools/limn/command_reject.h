#pragma once
// The command `limn reject`.
#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "tools/limn/command_support.h"

namespace limn {

struct RejectCommand {
  std::string output;  // folder
  std::string shape;   // id; "" for the one with the most edges
  std::vector<std::string> methods;
  std::optional<uint32_t> node;  // of the first method's tree
  uint32_t node_edges = 256;     // a node of about this size, if none is named
  double extent = 1.3;           // half-width of slices in radii of the mesh
  double distance = 0.5;         // between them
  std::optional<Vec3d> point;
  std::optional<Vec3d> view;  // from the mesh towards the camera
  Vec3d up{0, 1, 0};
  int size = 768;    // of pictures, pixels
  int points = 400;  // for the counts by depth and the acceptance rate
  bool report = true;
  std::string command_line;
};

// All but what CommonOptions hold.
void add_reject_options(CLI::App& app, RejectCommand& command);

}  // namespace limn
