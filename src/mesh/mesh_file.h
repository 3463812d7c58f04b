#pragma once
// Parsers of mesh files; limn/core/mesh.h lists their errors.
#include <string>

#include "src/mesh/mesh_build.h"

namespace limn {

// Parses OBJ or PLY, by extension.
RawMesh parse_mesh(const std::string& file);
RawMesh parse_obj(const std::string& file);  // read_obj.cpp
RawMesh parse_ply(const std::string& file);  // read_ply.cpp

struct SerializedMesh {
  RawMesh mesh;
  bool face_normals = false;  // the file wants flat shading
};
// Parses a mesh of Mitsuba's serialized format. index: of the mesh in the file, from 0.
SerializedMesh parse_serialized(const std::string& file, int64_t index);  // read_serialized.cpp

}  // namespace limn
