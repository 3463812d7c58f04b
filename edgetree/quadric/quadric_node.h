#pragma once
// Data of the paper's forest: nodes of up to four children side by side in lanes, and leaves of up
// to four edges.
#include <cstdint>
#include <vector>

#include "edgetree/bounds/quadric_pair.h"
#include "edgetree/forest/forest_node.h"
#include "limn/edgetree/edges.h"

namespace limn {

// A node of the paper's forest: >= 0 is an index of a QuadricNode, < 0 is ~index of a QuadricLeaf.
// The four roots of an object are the children of one QuadricNode, which is never chosen or tested
// itself.

struct QuadricNode {
  // As in InnerNode: the dual box. Rows' lengths add up to 1.
  FourFloats rows[4][4];  // [row][component of x]
  // Boxes around the edges in the frame of the node, outward: centers and half extents.
  FourFloats center[3], half[3];
  // Sum over edges of length * inverse_radius * exterior dihedral angle.
  FourFloats weight;
  int32_t child[kQuadricWidth];  // NodeId or kNoChild
  // The frame: x = ((p - origin) * inverse_radius, 1).
  float origin[3];
  float inverse_radius;
  uint32_t parent;  // kQuadricWidth * node + lane
  ShapeId object;
  ForestGroup group;
};

struct QuadricLeaf {
  int32_t edge[kQuadricWidth];  // index of an edge of the object, or kNoChild
  uint32_t parent;
  ShapeId object;
  ForestGroup group;
};

struct QuadricForest {
  std::vector<QuadricNode> nodes;
  std::vector<QuadricPairs> pairs;  // of each node's children; empty without quadrics
  std::vector<QuadricLeaf> leaves;
  std::vector<NodeId> roots;  // one per object and group, whose children are the roots
  double extent = 0;          // largest |x| of a position
  // [object][edge]: kQuadricWidth * leaf + lane, or kNoParent.
  std::vector<std::vector<uint32_t>> slots;

  uint32_t parent(NodeId id) const { return id < 0 ? leaves[~id].parent : nodes[id].parent; }
  const int32_t* lanes(NodeId id) const { return id < 0 ? leaves[~id].edge : nodes[id].child; }
  uint64_t bytes() const;
};

}  // namespace limn
