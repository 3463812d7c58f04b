#pragma once
// The invariants of a forest.
#include <span>
#include <string>

#include "edgetree/forest/forest_node.h"

namespace limn {

// Describes a violated invariant of a forest over the edges of `objects`; empty if all hold: unique
// parents and slots, boxes that hold their content, normalised rows.
std::string fault_of(const Forest& forest, std::span<const EdgeMesh> objects);

}  // namespace limn
