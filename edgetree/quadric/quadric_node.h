#pragma once
// Data of the paper's forest: nodes of up to four children in SIMD vectors, and leaves of up to
// four edges.
#include <cstdint>
#include <vector>

#include "edgetree/bounds/quadric_pair.h"
#include "edgetree/forest/forest_node.h"
#include "limn/edgetree/edges.h"

namespace limn {

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

}  // namespace limn
