#pragma once
// Data of the paper's forest: nodes of up to four children in SIMD vectors, and leaves of up to
// four edges; and how it is built.
#include <cstdint>
#include <span>
#include <vector>

#include "edgetree/bounds/forest_fit.h"
#include "edgetree/bounds/lanes.h"
#include "edgetree/bounds/pair_fit.h"
#include "edgetree/bounds/quadric_pair.h"
#include "edgetree/bounds/split_tree.h"
#include "edgetree/forest/forest_node.h"
#include "limn/edgetree/edge_sampler.h"
#include "limn/edgetree/edges.h"

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

// A node of the paper's forest: >= 0 is the index of a QuadricNode, < 0 is ~index of a QuadricLeaf.
// An object's four roots are the children of one QuadricNode, which is itself neither chosen nor
// tested.

struct QuadricNode {
  // The dual box, as in InnerNode. Row lengths sum to 1.
  FourFloats rows[4][4];  // [row][component of x]
  // Bounding boxes of the edges in the node's frame, rounded outward.
  FourFloats center[3], half[3];
  // Sum over edges of length * inverse_radius * exterior dihedral angle.
  FourFloats weight;
  int32_t child[kQuadricWidth];  // NodeId or kNoChild
  // The frame: x = ((p - origin) * inverse_radius, 1).
  float origin[3];
  float inverse_radius;
  uint32_t parent;  // kQuadricWidth * node + index of the child
  ShapeId object;
  ForestGroup group;
};

struct QuadricLeaf {
  int32_t edge[kQuadricWidth];  // index in the object, or kNoChild
  uint32_t parent;
  ShapeId object;
  ForestGroup group;
};

struct QuadricForest {
  std::vector<QuadricNode> nodes;
  std::vector<QuadricPairs> pairs;  // of each node's children; empty without quadrics
  std::vector<QuadricLeaf> leaves;
  std::vector<NodeId> roots;  // one per object and group; their children are the paper's roots
  double extent = 0;          // largest |x| of a position
  // [object][edge]: kQuadricWidth * leaf + index of the child, or kNoParent.
  std::vector<std::vector<uint32_t>> slots;

  uint32_t parent(NodeId id) const { return id < 0 ? leaves[~id].parent : nodes[id].parent; }
  const int32_t* lanes(NodeId id) const { return id < 0 ? leaves[~id].edge : nodes[id].child; }
  uint64_t bytes() const;
};

// Builds one tree per object and group with edges. The result does not depend on `threads`.
QuadricForest build_quadric_forest(const EdgeSamplerInput& input, int threads,
                                   const QuadricConfig& config);

// Nodes with at most kQuadricWidth edges are leaves.
using QuadricShape = SplitTree<kQuadricWidth>;

// A node's children result from three splits: of the node, and of both halves unless they are
// leaves. A split is the best, by the surface area heuristic, of ten equidistant planes along the
// longest axis of the edges' box. wedges: at least one.
QuadricShape shape_of(std::span<const Wedge> wedges, int threads);

// A fit in the frame of the node's parent.
struct QuadricFit {
  // As in InnerNode: planes of the box are row_0 + u_0 row_1 + u_1 row_2 + u_2 row_3 with u in
  // [-1, 1]^3, along arbitrary axes t_1, t_2, t_3 that complete Z (Sec. 3.2). Row lengths sum to
  // 1.
  double rows[4][4];
  PairFit pair;
};

// A fit that never rejects.
QuadricFit unrejectable_quadric_fit();
// A fit that holds all wedges. moments: of their planes, in the frame `own`; null: no quadrics.
QuadricFit fit_quadrics(std::span<const Wedge> wedges, const NodeFrame& frame,
                        const PlaneMoments* moments, const NodeFrame& own);

}  // namespace limn
