#pragma once
// Derivatives of computed shading normals.
#include "limn/core/mesh.h"

namespace limn {

// Updates normal_tangents of computed normals after a change of position_tangents; the rest must be
// up to date. Empty if all vertices move alike.
void update_shading_tangents(Mesh& mesh);

}  // namespace limn
