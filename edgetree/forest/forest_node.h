#pragma once
// Data of the edge forest: nodes of up to eight children in SIMD vectors. Children of inner nodes
// are nodes, children of edge nodes are edges.
#include <cstdint>
#include <memory>
#include <vector>

#include "edgetree/forest/forest_motion.h"
#include "edgetree/simd.h"
#include "limn/core/prefetch.h"
#include "limn/edgetree/edges.h"

namespace limn {

// Groups of edges that are rejected by the same test.
enum class ForestGroup : uint8_t {
  kSilhouette,  // smooth and flat: candidates if p is between their planes
  kFront,       // sharp, of closed one-sided meshes: candidates if p is in front of a face
  kFolds,       // other sharp edges between two faces: always candidates
  kAlways,      // boundary, irregular and other edges: always candidates
};
inline constexpr int kForestGroups = 4;
// Whether p may see both faces of edges of the group (folds). Other candidates are silhouettes.
constexpr bool has_folds(ForestGroup group) {
  return group == ForestGroup::kFront || group == ForestGroup::kFolds;
}
constexpr bool rejects_none(ForestGroup group) {
  return group == ForestGroup::kFolds || group == ForestGroup::kAlways;
}

// A node: >= 0 is the index of an inner node, < 0 is ~index of an edge node.
using NodeId = int32_t;
inline constexpr int32_t kNoChild = INT32_MIN;
inline constexpr uint32_t kNoParent = UINT32_MAX;

inline constexpr int kBoxBits = 10;
inline constexpr int kBoxSteps = (1 << kBoxBits) - 1;

// Common data of both kinds of nodes. In the node's frame x = ((p - center) * inverse_radius, 1).
struct NodeHead {
  float center[3];
  float inverse_radius;
  uint32_t parent;  // kWidth * inner node + index of the child
  ShapeId object;   // of nodes above several trees: that of one of them
  uint32_t motion;  // index in Forest::motions
  ForestGroup group;
  uint8_t height;  // 0 for edge nodes, else 1 + the largest height of a child
  float fold;      // EdgeMesh::fold_contrast, of edge nodes
};

// The least weight of a fold over that of a silhouette: every fold stays possible. Not tuned. Above
// it the weight is EdgeMesh::fold_contrast times twice the tangent of half the dihedral angle.
inline constexpr float kLeastFold = 1 / 64.0f;

// Dual boxes (README.md): planes of a child that pass through p satisfy row_0 . x + sum over k of
// u_k (row_k . x) = 0 for some u in [-1, 1]^3. Row lengths sum to 1.
struct alignas(64) InnerNode {
  Floats rows[4][4];  // [row][component of x]
  // Half the sum over edges of length * inverse_radius^2 times the wedge's extent along axis u_k:
  // the expected length cut by a random plane that crosses the box along axis k.
  Floats cover[3];
  NodeHead head;
  // Mean over edges of the residual speed of ObjectMotion; 0 only if none moves.
  Floats speed;
  Ints child;  // NodeId or kNoChild
  // Bounding boxes of the children: the frame's cube [-1, 1]^3 is kBoxSteps wide; bits 0 to 9 hold
  // x, then y, then z.
  Ints low, high;
  // Where the group has folds: the sum over edges of length * inverse_radius^2 times what each
  // counts as a fold.
  Floats folds;
  uint8_t ahead;  // one bit per child: weighted by its own children, see ForestConfig
};

// Dual boxes of edges: segments between the planes of their faces, u_0 in [-1, 1].
struct alignas(64) EdgeNode {
  Floats rows[2][4];
  Floats length;  // times inverse_radius^2; 0 if absent
  NodeHead head;
  Floats speed;
  Ints edge;  // index in the object, or kNoChild
  Floats ends[2]
             [3];  // world space: exact, or rounded where no ends are floats (crossings, textures)

  // The edge of a child that exists.
  EdgeRef edge_at(int lane) const {
    return {head.object, EdgeId(static_cast<uint32_t>(edge[lane]))};
  }
};

// For vectors whose elements are constructed when they are filled: until then they take no memory.
template <class T>
struct LateAllocator : std::allocator<T> {
  void construct(T*) {}
};

struct Forest {
  std::vector<InnerNode, LateAllocator<InnerNode>> inner;
  std::vector<EdgeNode, LateAllocator<EdgeNode>> edges;
  // Of the trees of objects and groups, or of nodes above many of them.
  std::vector<NodeId> roots;
  std::vector<NodeId> moving_roots;   // of them, those with edges that move by themselves
  std::vector<ObjectMotion> motions;  // no motion, then those of objects that move
  double extent = 0;                  // largest |x| of a position
  // [object][edge]: kWidth * edge node + index of the child, or kNoParent.
  std::vector<std::vector<uint32_t>> slots;

  // All edges that move as seen from a point are below these; at_rest: see is_at_rest.
  const std::vector<NodeId>& roots_for(bool at_rest) const {
    return at_rest ? moving_roots : roots;
  }
  // Prefetches the cache lines of a node.
  void fetch(NodeId id) const {
    const void* node = id < 0 ? static_cast<const void*>(&edges[~id]) : &inner[id];
    const size_t size = id < 0 ? sizeof(EdgeNode) : sizeof(InnerNode);
    constexpr size_t kLine = 64;
    for (size_t i = 0; i < size; i += kLine) {
      prefetch(static_cast<const char*>(node) + i);
    }
  }

  uint32_t slot(EdgeRef id) const { return slots[id.object.index()][id.edge.index()]; }
  NodeHead& head(NodeId id) { return id < 0 ? edges[~id].head : inner[id].head; }
  const NodeHead& head(NodeId id) const { return id < 0 ? edges[~id].head : inner[id].head; }
};

}  // namespace limn
