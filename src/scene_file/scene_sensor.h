#pragma once
// Sensor, film, reconstruction filter and sampler of a scene file.
#include "limn/core/exposure.h"
#include "limn/core/scene.h"
#include "src/scene_file/scene_properties.h"

namespace limn {

// What a batch gives its sensors, in place of what they do not have: each takes its share of the
// film's width.
struct SharedParts {
  const ObjectDescription* film = nullptr;     // null: none
  const ObjectDescription* sampler = nullptr;  // null: none
  int sensors = 1;
};

// Reads a sensor with its film, filter and sampler.
// Appends its shutter and its course to `exposure`, and whole lines to `warnings`.
Sensor read_sensor(const ObjectDescription& sensor, const SceneDescription& description,
                   Exposure& exposure, std::vector<std::string>& warnings,
                   const SharedParts& shared = {});

}  // namespace limn
