#pragma once
// The shape of the paper's trees: which edges share a node (Sec. 4.1).
#include <span>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/lanes.h"
#include "edgetree/bounds/split_tree.h"

namespace limn {

// Nodes of at most kQuadricWidth edges are leaves.
using QuadricShape = SplitTree<kQuadricWidth>;

// Three splits make a node's children: of the node, and of its two halves where they are no leaves.
// Each is the best, by the surface area heuristic, of ten planes at equal distances along the
// longest axis of the edges' box. wedges: at least one.
QuadricShape shape_of(std::span<const Wedge> wedges, int threads);

}  // namespace limn
