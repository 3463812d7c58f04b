#pragma once
// Scenes that break things, and what to ask of them.
#include <string>

#include "limn/core/scene.h"
#include "limn/integrators/gradient.h"
#include "limn/integrators/run.h"
#include "tests/fuzz/nasty/die.h"

namespace limn::nasty {

// Writes the scene of a seed and its meshes to a folder; the scene's file.
std::string write_scene(Die& die, const std::string& folder);

struct Request {
  GradientOptions options;
  RunSettings settings;
};
// folder: for velocity fields.
Request nasty_request(Die& die, const Scene& scene, const std::string& folder);

}  // namespace limn::nasty
