#pragma once
// Sensor, film, reconstruction filter and sampler of a scene file.
#include "limn/core/scene.h"
#include "src/scene_file/scene_properties.h"

namespace limn {

// Reads a sensor with its film, filter and sampler.
// Appends whole lines to `warnings`.
Sensor read_sensor(const ObjectDescription& sensor, const SceneDescription& description,
                   std::vector<std::string>& warnings);

}  // namespace limn
