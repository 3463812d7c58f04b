#pragma once
// Edges in front of specular reflections of small lights in flat glossy faces (mirrored_light.h),
// as one point sees them. Paths there are a hundred times brighter, which weights of edge samplers
// ignore. Within a cap of directions around each reflection, outlines, and edges of glossy shapes
// with both faces visible, are listed and drawn by what they would add; other samplers leave them
// out.
#include <optional>
#include <vector>

#include "integrators/lights/bright_patches.h"
#include "integrators/lights/mirrored_light.h"
#include "integrators/terms/direct_edges.h"
#include "integrators/terms/term.h"

namespace limn {

class HighlightEdges {
 public:
  // All must outlive it. mirrored: not null.
  HighlightEdges(const Scene& scene, const EdgeSamplerInput& edges, const EdgeSampler& sampler,
                 const MirroredLight& mirrored);

  // What one point sees.
  struct View {
    int count = 0;  // of caps that hold something in motion
    std::array<DirectionCap, MirroredLight::kMostImages> caps;
    std::vector<DirectPieces::Piece> pieces;  // `region` is the cap
  };
  // Replaces what is in `view`. query: of the vertex.
  void list(const PathVertex& vertex, const EdgeQuery& query, View& view) const;
  // Whether points drawn from the view stand for this one, of an edge that may be seen.
  bool hold(const View& view, const EdgeQuery& query, const EdgeSample& sample) const;
  // Replaces what is in `points`, those that the view stands for.
  void draw(const View& view, const EdgeQuery& query, const Rng& rng, int samples, TermCost& cost,
            std::vector<DirectPoint>& points) const;

 private:
  // Adds a piece of the cap that is next in the view, halved around its brightest point until its
  // directions are as close together as `narrow`. elsewhere: luminance beside the highlight.
  void add_pieces(const EdgeQuery& query, const MirroredLight::Highlight& highlight,
                  double elsewhere, EdgePiece piece, double narrow, View& view) const;
  // Whether the edge is between two faces that the point sees, one of which may show a highlight.
  bool is_of_gloss(EdgeRef edge, const Vec3d& p) const;
  Vec3d position(EdgeRef edge, double t) const;
  Vec3d direction(const EdgeQuery& query, const EdgeSample& sample) const;
  // The first cap that holds a direction.
  static std::optional<uint32_t> cap_of(const View& view, const Vec3d& omega);

  const EdgeSamplerInput& edges_;
  const EdgeSampler& sampler_;
  const MirroredLight& mirrored_;
  std::vector<ListedEdge> of_gloss_;  // sharp edges of glossy shapes
};

}  // namespace limn
