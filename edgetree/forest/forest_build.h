#pragma once
// Builds the trees of the edge forest.
#include <algorithm>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "edgetree/bounds/forest_config.h"
#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/split_tree.h"
#include "edgetree/forest/forest_node.h"
#include "edgetree/forest/wedge_list.h"
#include "edgetree/simd.h"
#include "limn/core/bounds.h"
#include "limn/edgetree/edge_sampler_types.h"
#include "limn/edgetree/rejection_tree.h"

namespace limn {

// The group of an edge; nothing if no query needs the edge.
std::optional<ForestGroup> group_of(const EdgeMesh& mesh, const Edge& edge, bool cull_concave);
Bounds bounds_of(std::span<const Wedge> wedges);
// Calls append(list, object, group) for every group of an object that has edges, in a fixed order.
template <class Append>
void for_trees_of(const EdgeMesh& mesh, ShapeId object, bool cull_concave, const Append& append) {
  size_t counts[kForestGroups] = {};
  for (const Edge& edge : mesh.edges) {
    if (const auto group = group_of(mesh, edge, cull_concave)) ++counts[static_cast<int>(*group)];
  }
  std::vector<WedgeList> groups(kForestGroups, WedgeList(mesh));
  for (int g = 0; g < kForestGroups; ++g) groups[g].reserve(counts[g]);
  for (uint32_t e = 0; e < mesh.edges.size(); ++e) {
    if (const auto group = group_of(mesh, mesh.edges[e], cull_concave)) {
      groups[static_cast<int>(*group)].add(EdgeId(e));
    }
  }
  for (int g = 0; g < kForestGroups; ++g) {
    if (groups[g].size() > 0) append(groups[g], object, static_cast<ForestGroup>(g));
  }
}
// Does the same for every object, after giving `trees` (Forest, QuadricForest) a slot for every
// edge.
template <class Trees, class Append>
void for_every_tree(const EdgeSamplerInput& input, bool cull_concave, Trees& trees,
                    const Append& append) {
  for (uint32_t o = 0; o < input.objects.size(); ++o) {
    const EdgeMesh& mesh = input.objects[o];
    trees.extent = std::max(trees.extent, mesh.extent);
    trees.slots.emplace_back(mesh.edges.size(), kNoParent);
    for_trees_of(mesh, ShapeId(o), cull_concave, append);
  }
}
// The frame of a node: its cube [-1, 1]^3 contains the box of its edges.
NodeFrame frame_of(const Bounds& box);

// Builds one tree per object and group with edges. The result does not depend on `threads`, nor on
// `shared`.
Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config,
                    SharedObjects* shared = nullptr);

// At most so many nodes of edges are expected: three quarters full, one more per object.
size_t expected_edge_nodes(const EdgeSamplerInput& input);

// The children of a node are all nodes, or, if it has at most `width` edges, one edge
// each.
using ForestShape = SplitTree<kWidth>;

// list: at least one wedge. width: 2 to kWidth.
ForestShape split_edges(const WedgeList& list, uint32_t width, int threads);

// Its nodes are the children of the forest's nodes. The forest must outlive it.
std::unique_ptr<RejectionTree> make_forest_rejection_tree(const Forest& forest);

}  // namespace limn
