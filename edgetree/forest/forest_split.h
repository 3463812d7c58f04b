#pragma once
// The shape of a tree: which edges share a node.
#include <cstdint>
#include <span>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/split_tree.h"
#include "edgetree/simd.h"

namespace limn {

// All children are nodes or, if a node has no more edges than `width`, all are edges, with a range
// each.
using ForestShape = SplitTree<kWidth>;

// wedges: at least one. width: 2 to kWidth.
ForestShape split_edges(std::span<const Wedge> wedges, uint32_t width, int threads);

}  // namespace limn
