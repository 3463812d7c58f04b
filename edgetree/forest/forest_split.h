#pragma once
// The topology of a forest tree: which edges share a node.
#include <cstdint>
#include <span>

#include "edgetree/bounds/split_tree.h"
#include "edgetree/forest/wedge_list.h"
#include "edgetree/simd.h"

namespace limn {

// The children of a node are all nodes, or, if it has at most `width` edges, one edge
// each.
using ForestShape = SplitTree<kWidth>;

// list: at least one wedge. width: 2 to kWidth.
ForestShape split_edges(const WedgeList& list, uint32_t width, int threads);

}  // namespace limn
