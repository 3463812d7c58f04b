#pragma once
// The invariants of the edges of a mesh.
#include <string>

#include "limn/edgetree/edges.h"

namespace limn {

// Describes the first invariant of EdgeMesh that is violated; empty if all hold.
std::string fault_of(const EdgeMesh& mesh);

}  // namespace limn
