#pragma once
// Derivatives of shading normals alone.
#include "limn/core/mesh.h"

namespace limn {

// Fills normal_tangents and horizon_tangents after a change of position_tangents or, of normals
// from the file, of theirs; the rest must be as update_shading_normals leaves it. Both are empty
// where all vertices move as one.
void update_shading_tangents(Mesh& mesh);

}  // namespace limn
