#pragma once
// What can move in a scene, one list per kind of thing (each appends to `list`). parameter.cpp
// joins them: a new kind of thing is a .cpp, a line here and a line there.
#include <vector>

#include "limn/core/parameter.h"

namespace limn {

void add_shape_parameters(const Scene& scene, std::vector<Parameter>& list);    // shape_motion.cpp
void add_camera_parameters(const Scene& scene, std::vector<Parameter>& list);   // camera_motion.cpp
void add_bsdf_parameters(const Scene& scene, std::vector<Parameter>& list);     // value_motion.cpp
void add_emitter_parameters(const Scene& scene, std::vector<Parameter>& list);  // value_motion.cpp
void add_texel_parameters(const Scene& scene, std::vector<Parameter>& list);    // texel_motion.cpp

}  // namespace limn
