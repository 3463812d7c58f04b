#pragma once
// Light that faces hide from the smooth surface which interpolated normals mean.
#include "limn/core/mesh.h"

namespace limn {

// The share of a uniform light that the outside of a mesh loses because faces are flat: of the
// directions above the smooth surface, in the cosine measure, those that lie below the face and
// meet it again from where rays start (limn/core/surface_lift.h). 0 where normals are the faces'.
// The mean over the area, without places whose normal opposes the face, which are dark or not with
// the side that is seen.
double lost_light(const Mesh& mesh);

}  // namespace limn
