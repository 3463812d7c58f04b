#pragma once
// Mitsuba's built-in shapes as triangles.
#include "src/mesh/mesh_build.h"

namespace limn {

RawMesh make_rectangle();  // [-1, 1]^2 in z = 0, facing +Z
RawMesh make_cube();       // [-1, 1]^3
RawMesh make_disk();       // of radius 1 in z = 0, facing +Z
RawMesh make_sphere();     // of radius 1
RawMesh make_cylinder();   // of radius 1 about +Z, from z = 0 to 1, without caps

}  // namespace limn
