#pragma once
// Parsers of mesh files; limn/core/mesh.h lists their errors.
#include <string>

#include "src/mesh/mesh_build.h"

namespace limn {

// Parses OBJ or PLY, by extension.
RawMesh parse_mesh(const std::string& file);
RawMesh parse_obj(const std::string& file);  // read_obj.cpp
RawMesh parse_ply(const std::string& file);  // read_ply.cpp

}  // namespace limn
