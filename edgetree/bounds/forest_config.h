#pragma once
// The choices of the edge forest.
#include <cstdint>

namespace limn {

// What is built and how children are weighed. The defaults are what pays; the rest is for
// comparison (edgetree/FIGURES.md). No choice biases an estimate.
struct ForestConfig {
  // Dual boxes along the principal axes of a node's planes; else along any axes.
  bool principal_axes = true;
  // Children weigh by how deep the query plane cuts their dual box; else all that are not rejected
  // weigh by length and distance alone.
  bool soft_weights = true;
  // Children weigh by the light that may come from behind them.
  bool light_term = true;
  // The same for an environment that is not uniform.
  bool environment_term = true;
  // Children and edges weigh by how fast they move across the line of sight; else by their speed
  // relative to p in any direction.
  bool normal_speed = true;
  // Children of a node, 2 to 8.
  uint32_t width = 8;
  // Children of at most this height weigh by the lengths that their own children expect, which for
  // nodes of edges (height 0) are exact. Fewer draws end without an edge, at the price of more
  // nodes read.
  static constexpr int kNoHeight = -1, kEdgesOnly = 0, kAnyHeight = 255;
  int look_ahead = 2;
  // Inner nodes have a pair of bounding quadrics beside their dual boxes, of all children that hold
  // `quadrics_from` to kMostQuadricEdges edges: nowhere, where it pays, or everywhere. More edges
  // are nearly never rejected, and fewer leave a box too little.
  enum class Quadrics : uint8_t { kNone, kWherePaid, kAll };
  static constexpr uint32_t kMostQuadricEdges = 8192;
  Quadrics quadrics = Quadrics::kNone;
  uint32_t quadrics_from = 32;
  // Where the box of a child says little of what it weighs, because the lobe is narrow or p is
  // near, what is inside is looked at: by one look further, and before narrow lobes by opening up
  // to this many nodes of the top. With 0 neither is done.
  int most_open = 8;
  // Concave smooth edges of closed one-sided meshes are left out.
  bool cull_concave = true;
};

}  // namespace limn
