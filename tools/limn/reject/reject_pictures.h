#pragma once
// The pictures of `limn reject`. Sizes of strokes go with those of the pictures.
#include <array>

#include "limn/edgetree/rejection_places.h"
#include "tools/limn/reject/mesh_view.h"

namespace limn {

// sRGB, 0xrrggbb; they differ in lightness, too, for the colour-blind.
inline constexpr std::array<uint32_t, kVerdicts> kVerdictColors = {0xd9d9d9, 0x2f6fb7, 0xf28e2b,
                                                                   0xd6006e};
inline constexpr uint32_t kSilhouetteColor = 0x2f6fb7, kFalseAcceptColor = 0xf28e2b,
                          kDeadEndColor = 0xf8d3a6, kPointColor = 0x202020, kNodeColor = 0xb3261e;

// What the pictures show beside a sampler's tree.
struct Subject {
  const Scene& scene;  // one shape
  const RayTracer& tracer;
  const EdgeSamplerInput& input;  // the edges of that shape
  int threads;
};

// The verdicts over a slice (judge_slice), smoothed along their borders, with the cut through the
// mesh; the cut through faces around the node's edges is thick.
Image slice_picture(const Subject& subject, const RejectionTree& tree, uint32_t node,
                    const Slice& slice, const std::vector<NodeVerdict>& verdicts);

// All that descents from p can meet; what the mesh hides is faint. clay: view.picture().
Image reach_picture(const MeshView& view, Image clay, const EdgeMesh& edges, const Reach& reach,
                    const Vec3d& p);

// A slice with its picture's colours, placed in space.
struct PlacedSlice {
  Slice slice;
  std::vector<NodeVerdict> verdicts;
};
// The mesh, the edges of the node, and the slices as panes.
Image overview_picture(const MeshView& view, const EdgeMesh& mesh, std::span<const EdgeRef> edges,
                       std::span<const PlacedSlice> slices);

}  // namespace limn
