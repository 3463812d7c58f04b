#pragma once
// Light that faces hide from the smooth surface that interpolated normals describe.
#include "limn/core/mesh.h"

namespace limn {

// The share of a uniform light that the outside of a mesh loses because faces are flat: of the
// directions above the smooth surface, in the cosine measure, those that lie below the face and
// meet it again from where rays start (limn/core/surface_lift.h). 0 where normals are the faces'.
// The mean over the area, but for points whose shading normal opposes the face.
double lost_light(const Mesh& mesh);

}  // namespace limn
