#pragma once
// What parameters move. Values (colours, roughness, radiance, texels) are none of it: where nothing
// moves, no edge of what is seen does, and derivatives need none.
#include <span>

#include "limn/core/parameter.h"

namespace limn {

struct Moved {
  bool vertices = false;
  bool camera = false;
  bool delta_lights = false;  // positions, and directions of those at infinity
  // Where paths go on from smooth lobes, as an index of refraction changes. moved_by leaves it
  // open; moved_in (integrators/terms/term.h) has it.
  bool rays = false;

  bool any() const { return vertices || camera || delta_lights || rays; }
  Moved operator|(const Moved& o) const {
    return {vertices || o.vertices, camera || o.camera, delta_lights || o.delta_lights,
            rays || o.rays};
  }
};

// The union of what the parameters move.
Moved moved_by(std::span<const Parameter> parameters);

}  // namespace limn
