#pragma once
// Derivatives of shading normals.
#include "limn/core/mesh.h"

namespace limn {

// Updates normal_tangents and horizon_tangents after a change of position_tangents (or of the
// tangents of normals from a file); the rest must be up to date. Both are empty if all vertices
// move alike.
void update_shading_tangents(Mesh& mesh);

}  // namespace limn
