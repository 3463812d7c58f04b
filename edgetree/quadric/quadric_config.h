#pragma once
// Settings of the paper's forest.

namespace limn {

// The defaults are the paper's; other settings are for comparison (edgetree/FIGURES.md). None
// biases an estimate.
struct QuadricConfig {
  // Bound nodes by pairs of quadrics in addition to dual boxes.
  bool quadrics = true;
  // Weight children by the share of their solid angle covered by polygonal lights (Sec. 3.6).
  bool light_term = true;
  // Skip concave smooth edges of closed one-sided meshes (Sec. 4.1).
  bool cull_concave = true;
};

}  // namespace limn
