#pragma once
// Mesh files as read: see limn/core/mesh.h for what is refused.
#include <string>

#include "src/mesh/mesh_build.h"

namespace limn {

// Obj or ply, by the ending of the file's name.
RawMesh parse_mesh(const std::string& file);
RawMesh parse_obj(const std::string& file);  // read_obj.cpp
RawMesh parse_ply(const std::string& file);  // read_ply.cpp

}  // namespace limn
