#pragma once
// Edges that part light from shadow, as lights without extent see them, and where their shadows
// fall. The formulas stand in shadow_boundary.cpp.
#include <algorithm>
#include <optional>
#include <span>
#include <vector>

#include "integrators/paths/path.h"
#include "integrators/terms/lifted_faces.h"
#include "integrators/terms/light_frames.h"
#include "limn/core/discrete_distribution.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// An edge that parts light from shadow, as seen from one light.
struct ShadowEdge {
  const DeltaLight* light;
  uint32_t viewpoint;  // the light's, in the order of the scene
  EdgeRef id;
  double sign;   // 1: the side G > 0 is lit; -1: the other
  double angle;  // how long it is as seen from the light [rad]; at infinity [scene units]
  Lanes speed;   // how fast its shadow moves, as seen from the light; only edge and light count
};

// Where the shadow of a point of an edge falls.
struct ShadowPoint {
  FaceRef face;
  Vec3d x;    // on the face
  Vec3d lit;  // where the shadow meets what rays start from at x (surface_point.h): x, or above it
  double m;   // see above; of x while the shadow is at `lit`
  // A point of the face hardly aside of x, how far it is from the nearest side, and the same of the
  // face's center.
  Vec3d inside;
  double depth;
  Vec3d center;
  double center_depth;
  double side;             // 1, -1: seen from outside, inside alone; 0: from both
  double probability = 1;  // of this point, among all where the shadow of the edge's point falls

  // Where a viewer at q sends a ray to learn whether x is seen: on the face, and off its sides by
  // more than a ray ends before it, so that a neighbour at whose edge x lies may hide it.
  Vec3d target(const Vec3d& q) const {
    const double wanted = 0x1p-17 * length(inside - q);
    return depth >= wanted ? inside
                           : inside + (center - inside) * std::min(1.0, wanted / center_depth);
  }
};

// Of an edge mesh, with its tangents.
Vec3<Dual> moving_vertex(const EdgeMesh& mesh, VertexId vertex);

class ShadowEdges {
 public:
  // Of edges and frames. lanes: how many derivative lanes of the scene are in use.
  ShadowEdges(const PathContext& context, const LightFrames& frames, int lanes);

  bool empty() const { return edges_.empty(); }
  size_t size() const { return edges_.size(); }
  double list_seconds() const { return list_seconds_; }

  const ShadowEdge& edge(uint32_t i) const { return edges_[i]; }
  std::span<const ShadowEdge> edges() const { return edges_; }
  // The edge at u in [0, 1), in proportion to how long it is and how fast it moves as the light
  // sees it.
  uint32_t choose(double u) const { return static_cast<uint32_t>(choice_.sample(u).index); }
  double probability(uint32_t i) const { return choice_.probability(i); }
  // One of the points where the shadow of the edge's point at t falls. key: chooses it.
  std::optional<ShadowPoint> cast(const ShadowEdge& edge, double t, const Rng& key,
                                  RayCount& rays) const;
  // dL of the point as it is seen from q along the unit direction omega.
  Rgb<double> difference(const ShadowEdge& edge, const ShadowPoint& point, const Vec3d& q,
                         const Vec3d& omega) const;

 private:
  std::optional<ShadowPoint> cast_on_face(const ShadowLine& line, FaceRef face,
                                          const Vec3d& inside) const;
  std::optional<ShadowPoint> choose_crossing(const ShadowLine& line, double s_max,
                                             std::optional<ShadowPoint> on_face, double u) const;
  void list(uint32_t light, ShapeId object);
  Vec3d lit_beside(const ShadowEdge& edge, const ShadowPoint& point) const;
  void weigh(size_t first, int lanes);

  const PathContext& context_;
  const LightFrames& frames_;
  const EdgeSamplerInput& input_;
  LiftedFaces lifted_;
  double reach_ = 0;  // longer than any line through the scene
  std::vector<ShadowEdge> edges_;
  DiscreteDistribution choice_;  // of an edge
  double list_seconds_ = 0;
};

}  // namespace limn
