#pragma once
// Integrators of a scene file: Mitsuba's types that estimate what limn's path tracer estimates.
#include "limn/core/scene.h"
#include "src/scene_file/scene_properties.h"

namespace limn {

// Reads depths and hide_emitters into `scene`. Parameters that change how Mitsuba samples, not
// what, are ignored. InputError for other types. Appends whole lines to `warnings`.
void read_integrator(const ObjectDescription& object, const SceneDescription& description,
                     Scene& scene, std::vector<std::string>& warnings);

}  // namespace limn
