#pragma once
// Lists of the parameters of a scene, one function per kind (each appends to `list`). A new kind is
// a .cpp file, a line here and a line in parameter.cpp.
#include <vector>

#include "limn/core/parameter.h"

namespace limn {

void add_shape_parameters(const Scene& scene, std::vector<Parameter>& list);    // shape_motion.cpp
void add_camera_parameters(const Scene& scene, std::vector<Parameter>& list);   // camera_motion.cpp
void add_course_parameters(const Scene& scene, std::vector<Parameter>& list);   // course_motion.cpp
void add_bsdf_parameters(const Scene& scene, std::vector<Parameter>& list);     // value_motion.cpp
void add_emitter_parameters(const Scene& scene, std::vector<Parameter>& list);  // value_motion.cpp
void add_texel_parameters(const Scene& scene, std::vector<Parameter>& list);    // texel_motion.cpp

}  // namespace limn
