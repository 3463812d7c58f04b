#pragma once
// Settings of the edge forest.
#include <cstdint>

namespace limn {

// How trees are built and children are weighted. The defaults are the best settings; the others
// exist for comparison (edgetree/FIGURES.md). None biases an estimate.
struct ForestConfig {
  // Align dual boxes with the principal axes of a node's planes; else with arbitrary axes.
  bool principal_axes = true;
  // Weight children by how deep the query plane cuts their dual box; else by length and distance
  // alone, if not rejected.
  bool soft_weights = true;
  // Weight children by the light that may arrive from behind them.
  bool light_term = true;
  // Include an environment that is not uniform in the light term.
  bool environment_term = true;
  // Weight children and edges by their speed across the line of sight; else by their speed relative
  // to p in any direction.
  bool normal_speed = true;
  // Maximum number of children per node, 2 to 8.
  uint32_t width = 8;
  // Two-level importance: children of at most this height are weighted by the expected lengths of
  // their own children, exact for nodes of edges (height 0). Fewer draws are rejected, but more
  // nodes are read.
  static constexpr int kNoHeight = -1, kEdgesOnly = 0, kAnyHeight = 255;
  int look_ahead = 2;
  // Node expansion: a child's box bounds its weight loosely if the lobe is narrow or p is near.
  // Then its own children are evaluated, and for narrow lobes up to this many nodes at the top are
  // expanded. 0 disables both.
  int most_open = 8;
  // Skip concave smooth edges of closed one-sided meshes.
  bool cull_concave = true;
};

}  // namespace limn
