#pragma once
// The first choice of a descent: a tree.
#include <algorithm>
#include <span>

#include "edgetree/forest/forest_node.h"

namespace limn {

inline double below_one(double u) { return std::clamp(u, 0.0, 0x1.fffffffffffffp-1); }

// Draws a tree in proportion to choice_at(root).total by the uniform number u, which is rescaled to
// be uniform again; `chosen`: its choice; total: over all trees. False if all weights are zero.
template <class Choice, class ChoiceAt>
bool choose_root(std::span<const NodeId> roots, const ChoiceAt& choice_at, double& u,
                 Choice& chosen, double& total) {
  bool any = false;
  total = 0;
  for (const NodeId root : roots) {
    const Choice next = choice_at(root);
    total += next.total;
    const double share = next.total > 0 ? next.total / total : 0;
    if (u < share) {
      u = below_one(u / share);
      chosen = next;
      any = true;
    } else if (any) {
      u = below_one((u - share) / (1 - share));
    }
  }
  return any;
}

}  // namespace limn
