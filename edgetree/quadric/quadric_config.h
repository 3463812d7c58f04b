#pragma once
// The choices of the paper's forest.

namespace limn {

// The defaults are the paper's; the rest is for comparison (edgetree/FIGURES.md). No choice biases
// an estimate.
struct QuadricConfig {
  // Nodes have pairs of bounding quadrics beside their dual boxes.
  bool quadrics = true;
  // Children weigh by the part of their solid angle that polygonal lights fill (Sec. 3.6).
  bool light_term = true;
  // Concave smooth edges of closed one-sided meshes are left out (Sec. 4.1).
  bool cull_concave = true;
};

}  // namespace limn
