#pragma once
// Data of the edge forest: nodes of up to eight children, side by side in SIMD lanes. Inner nodes
// have nodes for children, edge nodes have edges.
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "edgetree/bounds/quadric_pair.h"
#include "edgetree/forest/forest_motion.h"
#include "edgetree/simd.h"
#include "limn/edgetree/edges.h"

namespace limn {

// Edges are kept apart by how they can be rejected.
enum class ForestGroup : uint8_t {
  kSilhouette,  // smooth and flat: where p lies between the planes of its faces
  kFront,       // sharp, of closed one-sided meshes: where p is in front of a face
  kAlways,      // borders, irregular edges, and sharp edges of other meshes: for every p
};
inline constexpr int kForestGroups = 3;

// A node: >= 0 is an index of an inner node, < 0 is ~index of an edge node.
using NodeId = int32_t;
inline constexpr int32_t kNoChild = INT32_MIN;
inline constexpr uint32_t kNoParent = UINT32_MAX;

inline constexpr uint32_t kNoPairs = UINT32_MAX;

inline constexpr int kBoxBits = 10;
inline constexpr int kBoxSteps = (1 << kBoxBits) - 1;

// What both kinds of nodes have. In the frame of a node x = ((p - center) * inverse_radius, 1).
struct NodeHead {
  float center[3];
  float inverse_radius;
  uint32_t parent;  // kWidth * inner node + lane
  ShapeId object;
  ForestGroup group;
  uint8_t height;  // 0 for nodes of edges, else one more than the highest child's
};

// Planes of a child that pass through p satisfy row_0 . x + sum over k of u_k (row_k . x) = 0 for
// some u in [-1, 1]^3: the dual box (README.md). Rows are scaled so that their lengths add up to 1.
struct alignas(64) InnerNode {
  Floats rows[4][4];  // [row][component of x]
  // Half the sum over edges of length * inverse_radius^2 times what their wedges cover of axis u_k:
  // a plane that crosses the box at random along axis k crosses wedges of this length on average.
  Floats cover[3];
  NodeHead head;
  // Of what ObjectMotion leaves out, mean over the edges; 0 only if none moves.
  Floats speed;
  Ints child;  // NodeId or kNoChild
  // Boxes around the children: the cube [-1, 1]^3 of the frame is kBoxSteps wide; bits 0 to 9 are
  // x, then y, then z.
  Ints low, high;
  uint8_t ahead;  // bit per lane: the child weighs by its own children, see ForestConfig
  uint32_t pairs = kNoPairs;  // index in Forest::pairs
};

// Pairs of bounding quadrics of a node's children, in the coordinates of their dual boxes.
struct ForestPairs {
  QuadricPairs halves[kWidth / kQuadricWidth];
};

// An edge's dual box is the segment between the planes of its faces: u_0 in [-1, 1].
struct alignas(64) EdgeNode {
  Floats rows[2][4];
  Floats length;  // times inverse_radius^2; 0 where there is no edge
  NodeHead head;
  Floats speed;
  Ints edge;          // index of an edge of the object, or kNoChild
  Floats ends[2][3];  // world space: exactly; of crossing curves to the nearest float

  // In a lane that has one.
  EdgeRef edge_at(int lane) const {
    return {head.object, EdgeId(static_cast<uint32_t>(edge[lane]))};
  }
};

struct Forest {
  std::vector<InnerNode> inner;
  std::vector<EdgeNode> edges;
  std::vector<ForestPairs> pairs;  // of the inner nodes that have them
  std::vector<NodeId> roots;
  std::vector<ObjectMotion> motions;  // of the objects
  double extent = 0;                  // largest |x| of a position
  // [object][edge]: kWidth * edge node + lane, or kNoParent.
  std::vector<std::vector<uint32_t>> slots;

  // What does not hold of these trees over the edges of `objects`, in words; empty if all is well:
  // every node has one parent, every edge one lane, boxes hold what is below, rows are scaled.
  std::string validate(std::span<const EdgeMesh> objects) const;

  // Brings the lines of a node into the cache.
  void fetch(NodeId id) const {
    const void* node = id < 0 ? static_cast<const void*>(&edges[~id]) : &inner[id];
    const size_t size = id < 0 ? sizeof(EdgeNode) : sizeof(InnerNode);
    constexpr size_t kLine = 64;
    for (size_t i = 0; i < size; i += kLine) {
      __builtin_prefetch(static_cast<const char*>(node) + i);
    }
  }

  uint32_t slot(EdgeRef id) const { return slots[id.object.index()][id.edge.index()]; }
  NodeHead& head(NodeId id) { return id < 0 ? edges[~id].head : inner[id].head; }
  const NodeHead& head(NodeId id) const { return id < 0 ? edges[~id].head : inner[id].head; }
};

}  // namespace limn
