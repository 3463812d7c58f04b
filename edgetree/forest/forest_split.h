#pragma once
// The topology of a forest tree: which edges share a node.
#include <cstdint>
#include <span>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/split_tree.h"
#include "edgetree/simd.h"

namespace limn {

// The children of a node are all nodes, or, if it has at most `width` edges, one edge
// each.
using ForestShape = SplitTree<kWidth>;

// wedges: at least one. width: 2 to kWidth.
ForestShape split_edges(std::span<const Wedge> wedges, uint32_t width, int threads);

}  // namespace limn
