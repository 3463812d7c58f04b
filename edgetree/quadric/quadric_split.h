#pragma once
// The topology of the paper's trees: which edges share a node (Sec. 4.1).
#include <span>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/lanes.h"
#include "edgetree/bounds/split_tree.h"

namespace limn {

// Nodes with at most kQuadricWidth edges are leaves.
using QuadricShape = SplitTree<kQuadricWidth>;

// A node's children result from three splits: of the node, and of both halves unless they are
// leaves. A split is the best, by the surface area heuristic, of ten equidistant planes along the
// longest axis of the edges' box. wedges: at least one.
QuadricShape shape_of(std::span<const Wedge> wedges, int threads);

}  // namespace limn
