#pragma once
// Where to inspect a rejection test: a node that is accepted and rejected about equally often, and
// slices of space around it.
#include <array>

#include "limn/edgetree/rejection.h"

namespace limn {

// A node with about `edges` edges (within a factor of 3/2, or else the nearest number) that holds
// edges of E(p) for about half of the queries: curved enough to be accepted often, flat enough to
// be rejected often. The tree must have a node.
uint32_t balanced_node(const EdgeSamplerInput& input, const RejectionTree& tree, uint32_t edges,
                       std::span<const EdgeQuery> queries);

// The node with the best agreement with a set of edges: intersection over union.
struct Match {
  uint32_t node = 0;
  double overlap = 0;  // intersection over union, in [0, 1]
};
Match best_match(const EdgeSamplerInput& input, const RejectionTree& tree,
                 std::span<const EdgeRef> edges);

// A surface patch with orthonormal axes.
struct Patch {
  Vec3d center;        // center of the bounds of its edges
  double radius;       // half the diagonal of the bounds
  Vec3d normal;        // mean of the faces around its edges
  Vec3d bend, across;  // the tangents along which normals vary most and least
};
Patch patch_of(const EdgeSamplerInput& input, std::span<const EdgeRef> edges);

// Two parallel squares of half-width `extent`, with the patch's normal up and bend to the right:
// one through its center, the other displaced by `distance` along `across`.
std::array<Slice, 2> slices_around(const Patch& patch, double extent, double distance, int size);

}  // namespace limn
