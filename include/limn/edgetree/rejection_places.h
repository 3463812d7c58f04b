#pragma once
// Where to look at a rejection test: a node that is often accepted and often rejected, and slices
// of space around it.
#include <array>

#include "limn/edgetree/rejection.h"

namespace limn {

// A node with about `edges` edges (within a factor of 3/2, or else the nearest): the one that holds
// edges of E(p) for about half of the queries: a patch curved enough to be accepted often and
// flat enough to be rejected often. The tree has a node.
uint32_t balanced_node(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t edges,
                       std::span<const EdgeQuery> queries);

// The node whose edges agree best with a set of edges: most in common over most in either.
struct Match {
  uint32_t node = 0;
  double overlap = 0;  // in [0, 1]: edges in both over edges in either
};
Match best_match(const EdgeSamplerInput& input, const RejectionTree& tree,
                 std::span<const EdgeRef> edges);

// A patch of surface: unit axes at right angles.
struct Patch {
  Vec3d center;        // of the bounds of its edges
  double radius;       // half the diagonal of the bounds
  Vec3d normal;        // mean of the faces around its edges
  Vec3d bend, across;  // the tangents along which normals vary most and least
};
Patch patch_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges);

// Two parallel squares of half-width `extent` in the plane of the patch's normal (up) and bend (to
// the right): one through its center and one that is `distance` off, along `across`.
std::array<Slice, 2> slices_around(const Patch& patch, double extent, double distance, int size);

}  // namespace limn
