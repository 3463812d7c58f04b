#pragma once
// What methods that look around from one vertex have in common: the light that they know.
#include <string>

#include "limn/core/error.h"
#include "limn/core/scene.h"

namespace limn {

// InputError at a place of the scene's file, with the method's name.
[[noreturn]] void refuse_light(const std::string& method, const SourceLocation& where,
                               const std::string& what);
// A kind, and its id in quotes if it has one.
std::string quoted_name(const std::string& kind, const std::string& id);
std::string shape_in_text(const Shape& shape);

// InputError for textured emitters.
void check_plain_emitters(const Scene& scene, const std::string& method);

// InputError, with what to do, for textured emitters, for a scene of other than direct light, for
// delta lights, and for interpolated normals after Mitsuba.
void check_direct_light(const Scene& scene, const std::string& method);

}  // namespace limn
