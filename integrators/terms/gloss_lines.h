#pragma once
// Edges beside glossy faces in the light of delta lights, found from the edge's side. From close by
// and at a grazing angle such a face is a hundred times as bright as all else, and few points of
// other surfaces see it so: pixels rarely meet them. So a point of the edge is drawn first, then a
// direction into which the face scatters the light. It meets the vertex q that sees the edge, where
// what the edge adds over this density is bounded. Both ways to the edge and q share the samples by
// the power heuristic; any shares that add up to one are right. Vertices on surfaces with
// interpolated normals have all of theirs.
#include <optional>
#include <vector>

#include "integrators/terms/seen_vertex.h"
#include "limn/core/discrete_distribution.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

class GlossLines {
 public:
  // Both must outlive it. Static edges are left to vertices, unless the camera moves or, in reverse
  // mode, all vertices are free.
  GlossLines(const PathContext& context, const EdgeSamplerInput& edges, bool free);

  bool empty() const { return lit_.empty(); }

  struct Line {
    EdgeRef edge;
    double t;
    SeenVertex vertex;  // may be hidden from the camera
  };
  // u in [0, 1) chooses the edge, rng the rest; through a point of the lens.
  std::optional<Line> draw(double u, Rng& rng, const LensPoint& lens, RayCount& rays) const;

  struct Share {
    double density = 0;  // of the edge, t and the vertex on the film [1 / pixel^2]
    double share = 0;    // of lines; the vertex has the rest
  };
  Share share(const Line& line) const;

 private:
  // A face beside an edge, and one light.
  struct Lit {
    EdgeRef edge;
    FaceId face;
    const DeltaLight* light;
  };
  void list(ShapeId object, bool all);
  Vec3d position(EdgeRef edge, double t) const;
  // What the face scatters at x, as the light sees it; none where it is dark.
  std::optional<Scattering<double>> at(const Lit& lit, const Vec3d& x) const;

  const PathContext& context_;
  const EdgeSamplerInput& edges_;
  std::vector<Lit> lit_;  // in the order of objects and edges
  DiscreteDistribution choice_;
};

}  // namespace limn
