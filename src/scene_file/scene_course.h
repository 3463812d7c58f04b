#pragma once
// Shutters and animations of a scene file.
#include "limn/core/exposure.h"
#include "src/scene_file/scene_properties.h"

namespace limn {

// The middle of the shutter of the first sensor; 0 without one.
double reference_time(const SceneDescription& description);

// shutter_open and shutter_close. InputError if it closes before it opens.
Shutter read_shutter(Properties& properties);

// to_world at a time: of a transform or an animation, whose keyframes `course` gets. These must
// differ by rotations, translations and uniform scales alone; else InputError at a keyframe.
Matrix4 read_course(DescribedProperties& properties, double time, Course& course);

}  // namespace limn
