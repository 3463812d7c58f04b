#pragma once
// Integrator, sensor, film, filter, sampler, shutter and animations of a scene file.
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

// Reads depths and hide_emitters into `scene`. Parameters that change how Mitsuba samples, not
// what, are ignored. InputError for other types. Appends whole lines to `warnings`.
void read_integrator(const ObjectDescription& object, const SceneDescription& description,
                     Scene& scene, std::vector<std::string>& warnings);

// The middle of the shutter of the first sensor; 0 without one.
double reference_time(const SceneDescription& description);

// shutter_open and shutter_close. InputError if it closes before it opens.
Shutter read_shutter(Properties& properties);

// to_world at a time: of a transform or an animation, whose keyframes `course` gets. These must
// differ by rotations, translations and uniform scales alone; else InputError at a keyframe.
Matrix4 read_course(DescribedProperties& properties, double time, Course& course);

}  // namespace limn
