#pragma once
// Scene parameters that can be differentiated, by name:
//   <shape id>.translate.x|y|z   scene units         <shape id>.rotate.x|y|z   radians, world axes
//   through the centre of its bounding box <shape id>.scale             factor - 1, about the
//   centre of its bounding box <shape id>.vertex_positions:FILE   moves every vertex by the
//   parameter times the vector in FILE sensor.translate.x|y|z       sensor.rotate.x|y|z (radians,
//   world axes through the pinhole)      sensor.fov (degrees) <bsdf id>.NAME, <emitter id>.NAME
//   (see their parameters())
#include <string>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

struct ParameterInfo {
  std::string name;
  std::string unit;
  double natural_step;  // a small step: about a hundredth of what changes the picture a lot
};

// All parameters of the scene, vertex_positions with FILE left open.
std::vector<ParameterInfo> list_parameters(const Scene& scene);

// The parameter called `name`; InputError that lists the nearest known names if there is none.
ParameterInfo find_parameter(const Scene& scene, const std::string& name);

// Adds derivative lane `lane` of everything in the scene that the parameter moves.
void seed_parameter(Scene& scene, const std::string& name, int lane);

// A copy of the scene with the parameter moved by `step`; exact for large steps (rotations rotate).
// Tangents are kept as they are.
Scene perturbed(const Scene& scene, const std::string& name, double step);

}  // namespace limn
