#pragma once
// Lines from regions of light through points of edges, for the term `penumbra`.
#include <optional>

#include "integrators/paths/path.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/vertex_edges.h"

namespace limn {

struct DrawnLine {
  EdgeSample edge;  // probability: of the edge, times the line's density once that is complete
  FaceRef face;     // that the line meets
  EmitterLine line;
};

// The same, complete, and as a vertex of a path sees where it ends.
struct SeenLine {
  DrawnLine drawn;
  SeenAlong along;  // from the vertex
  Rgb<double> f;    // of the vertex's scattering
};

class PenumbraLines {
 public:
  // All must outlive it.
  PenumbraLines(const PathContext& context, const EdgeSamplerInput& edges,
                const LightRegions& regions, const EmitterEdges& emitter_edges)
      : context_(context), edges_(edges), regions_(regions), emitter_edges_(emitter_edges) {}

  // u: in [0, 1), chooses the edge and its region. None if the line meets nothing.
  std::optional<DrawnLine> draw(double u, Rng& rng, RayCount& rays) const;
  // Completes the density of a drawn line for who sees where it ends (penumbra_share()). False
  // where the line belongs to `direct`; where nearly all does, mostly.
  bool complete(DrawnLine& drawn, const PathStep& step, int bounces, Rng& rng) const;

  // One drawn for a vertex; books what becomes of it. None if it adds nothing there.
  std::optional<SeenLine> seen_from(const PathVertex& vertex, const Rng& key, TermCost& cost) const;

 private:
  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  const LightRegions& regions_;
  const EmitterEdges& emitter_edges_;
};

}  // namespace limn
