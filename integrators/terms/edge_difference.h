#pragma once
// The difference of incident radiance across an edge, as seen from a point.
#include <limits>

#include "integrators/lights/light_regions.h"
#include "integrators/paths/path.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// A point on an edge seen from p.
struct EdgeView {
  EdgeRef id;
  Vec3d p;
  Vec3d x0, x1;  // ends of the edge
  Vec3d y;       // the point, (1 - t) x0 + t x1
  Vec3d omega;   // unit direction from p to y
  double distance = 0;
  // (x0 - p) x (x1 - p): directions w with w.side > 0 lie on the positive side of the edge.
  Vec3d side;
};
// False if y coincides with p.
bool view_edge(const EdgeMesh& mesh, EdgeRef id, double t, const Vec3d& p, EdgeView& view);

// Who looks at an edge from p.
struct EdgeViewer {
  FaceRef start;  // the face that p lies on
  int bounces;    // how often the path has scattered, p included
  const Rng& key;
  RadiancePart part = {};
  // Where rays from p begin and end (the clip planes of a camera).
  double t_min = 0, t_max = std::numeric_limits<double>::infinity();
};

// Estimates dL: radiance that arrives at p from just beside y on the negative side, minus that on
// the positive side. False if y is hidden from p. Each side shows the nearest of the faces around
// the edge that lie on that side, or, where there is none, what lies behind the edge: the same rule
// for silhouettes, borders, sharp edges and edges of many faces. The unit directions and both faces
// are exact, nothing is offset.
bool edge_difference(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
                     const EdgeViewer& viewer, RayCount& rays, Rgb<double>& difference);

}  // namespace limn
