#pragma once
// The jump of incident radiance across an edge, as seen from a point.
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

// Estimates dL: radiance that arrives at p from just beside y on the negative side, minus that on
// the positive side. False if y is hidden from p. Each side shows the nearest of the faces around
// the edge that lie on that side, or, where there is none, what lies behind the edge: the same rule
// for silhouettes, borders, sharp edges and edges of many faces. start: the face that p lies on;
// t_min, t_max: where rays from p begin and end (the clip planes of a camera); bounces: how often
// the path has scattered, p included; part: of the radiance; known_behind: y is seen, and what lies
// behind the edge is this face, or none (null: a ray tells both). The unit directions and both
// faces are exact, nothing is offset.
bool edge_difference(const PathContext& context, const EdgeMesh& mesh, const EdgeView& view,
                     FaceRef start, double t_min, double t_max, int bounces, const Rng& key,
                     RayCount& rays, Rgb<double>& jump, const RadiancePart& part = {},
                     const FaceRef* known_behind = nullptr);

}  // namespace limn
