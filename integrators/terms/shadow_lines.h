#pragma once
// Points of shadows that light up a surface close by, found from the shadow's side. At a vertex q
// at the distance r from a shadow's edge what the edge adds goes with 1 / r, and pixels may be much
// larger than r. So a share of the samples of the film draws a point x of a shadow first, then a
// direction from x, by the cosine or by the lobe of its face, which meets q: this density goes with
// 1 / r^2, as the sample does, and is high where gloss throws light. Both ways to x and q share
// them by the power heuristic; any shares that add up to one are right. Rays leave surfaces with
// interpolated normals above their faces (surface_point.h), where these lines do not end: vertices
// have all of theirs.
#include <optional>

#include "integrators/terms/seen_vertex.h"
#include "integrators/terms/shadow_edges.h"

namespace limn {

class ShadowLines {
 public:
  // The share of the samples of the film that draw lines. With 0.5 instead of 0.2 a thin plate on a
  // floor has 0.5 of the variance, and shadows that the camera itself sees have 1.6 of it.
  static constexpr double kShare = 0.25;

  // Both must outlive it.
  ShadowLines(const PathContext& context, const EdgeSamplerInput& input)
      : context_(context), input_(input) {}

  // The vertex that a line from a point meets by uniform numbers, which may be hidden from the
  // camera.
  std::optional<SeenVertex> draw(const ShadowEdge& edge, const ShadowPoint& point, double u_0,
                                 double u_1, const LensPoint& lens, RayCount& rays) const;
  // Density on the film of `draw` [1 / pixel^2].
  double density(const ShadowEdge& edge, const ShadowPoint& point, const SeenVertex& vertex) const;
  // What lines have of the point and the vertex. probability: of the edge; by_line: `density`;
  // scattering: at the vertex.
  double share(const ShadowEdge& edge, double probability, const ShadowPoint& point,
               const SeenVertex& vertex, double by_line,
               const Scattering<double>& scattering) const;

 private:
  const PathContext& context_;
  const EdgeSamplerInput& input_;
};

}  // namespace limn
