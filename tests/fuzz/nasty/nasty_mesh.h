#pragma once
// Meshes that break things.
#include <string>
#include <vector>

#include "limn/core/mesh.h"
#include "tests/fuzz/nasty/die.h"

namespace limn::nasty {

struct NastyMesh {
  std::vector<Vec3d> positions;
  std::vector<FaceIndices> faces;
  std::vector<Vec3d> normals;  // one per position, or none
};

// Around the origin, of size 1 as a rule. Never without a face.
NastyMesh nasty_mesh(Die& die);

// As an OBJ file.
std::string obj_text(const NastyMesh& mesh);

}  // namespace limn::nasty
