#pragma once
// Data of the edge forest: nodes of four children, side by side in SIMD lanes.
#include <cstdint>
#include <vector>

#include "limn/edgetree/edges.h"
#include "simd4.h"

namespace limn {

// Edges are kept apart by how they can be rejected.
enum class ForestGroup : uint8_t {
  kSilhouette,  // smooth and flat: where p lies between the planes of its faces
  kFront,       // sharp, of closed one-sided meshes: where p is in front of a face
  kAlways,      // borders, irregular edges, and sharp edges of other meshes: for every p
};
inline constexpr int kForestGroups = 3;

// A child: 0 none; positive: index of a node (node 0 is a root, nobody's child); negative: ~edge.
inline constexpr int32_t kNoChild = 0;
inline constexpr uint32_t kNoParent = UINT32_MAX;

// In the frame of a node x = ((p - center) / radius, 1). Planes of a child that pass through p
// satisfy  row_0 . x + sum over k of u_k (row_k . x) = 0  for some u in [-1, 1]^3: the dual box
// (README.md). Rows are scaled so that their lengths add up to 1.
struct ForestNode {
  Float4 rows[4][4];     // [row][component of x]
  Float4 box_center[3];  // positions, in the frame
  Float4 box_half[3];    // not negative
  // Half the sum over edges of length / radius^2 times what their wedges cover of axis u_k: a plane
  // that crosses the box at random along axis k crosses wedges of this length on average.
  Float4 cover[3];
  Float4 speed;  // mean over the edges; 0 only if none moves
  Int4 child;
  float center[3];
  float radius;
  uint32_t parent;  // 4 * node + lane
  uint32_t object;
  ForestGroup group;
  uint8_t twigs;  // bit per lane: the child is a node of edges only
};

struct Forest {
  std::vector<ForestNode> nodes;
  std::vector<uint32_t> roots;               // nodes
  double extent = 0;                         // largest |x| of a position
  std::vector<std::vector<uint32_t>> slots;  // [object][edge]: 4 * node + lane, or kNoParent
};

}  // namespace limn
