#pragma once
// Lines from regions of light through points of edges, for the term `penumbra`.
#include <optional>

#include "integrators/paths/path.h"
#include "integrators/terms/penumbra.h"
#include "integrators/terms/seen_vertex.h"
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
      : context_(context), ways_(emitter_ways(context, edges, regions, emitter_edges)) {}

  const EmitterWays& ways() const { return ways_; }

  // u: in [0, 1), chooses the edge and its region. None if the line meets nothing.
  std::optional<DrawnLine> draw(double u, Rng& rng, RayCount& rays) const;
  // Completes the density of a drawn line for who sees where it ends (penumbra_share()). scattered:
  // who sees it was found from there. False where the line belongs to other ways; where nearly all
  // does, mostly.
  bool complete(DrawnLine& drawn, const PathStep& step, int bounces, Rng& rng,
                bool scattered = false) const;
  // Where a line is scattered to by uniform numbers, which may be hidden from the camera.
  std::optional<SeenVertex> scatter(const DrawnLine& drawn, double u_0, double u_1,
                                    const LensPoint& lens, RayCount& rays) const;
  // How a path comes from a vertex to p, in the unit direction omega.
  PathStep step_from(const PathVertex& vertex, const Vec3d& omega) const;

  // One drawn for a vertex; books what becomes of it. None if it adds nothing there.
  std::optional<SeenLine> seen_from(const PathVertex& vertex, const Rng& key, TermCost& cost) const;

 private:
  const PathContext& context_;
  EmitterWays ways_;
};

}  // namespace limn
