#pragma once
// Edges that part light from shadow, as lights without extent see them, and where their shadows
// fall. The formulas stand in shadow_boundary.cpp.
#include <optional>
#include <vector>

#include "integrators/terms/path.h"
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
  Vec3d x;
  double m;      // see above
  Vec3d inside;  // a point of the face that is hardly aside of x, where rays tell whether x is seen
};

// Of an edge mesh, with its tangents.
Vec3<Dual> moving_vertex(const EdgeMesh& mesh, VertexId vertex);

class ShadowEdges {
 public:
  // lanes: how many derivative lanes of the scene are in use.
  ShadowEdges(const PathContext& context, const EdgeSamplerInput& input, int lanes);

  bool empty() const { return edges_.empty(); }
  size_t size() const { return edges_.size(); }
  double list_seconds() const { return list_seconds_; }

  // The edge at u in [0, 1), and its probability.
  const ShadowEdge& choose(double u, double& probability) const;
  std::optional<ShadowPoint> cast(const ShadowEdge& edge, double t, RayCount& rays) const;
  // dL of the point as it is seen from q along the unit direction omega.
  Rgb<double> jump(const ShadowEdge& edge, const ShadowPoint& point, const Vec3d& q,
                   const Vec3d& omega) const;

 private:
  void list(uint32_t light, ShapeId object);
  void weigh(size_t first, int lanes);

  const PathContext& context_;
  const EdgeSamplerInput& input_;
  double reach_ = 0;  // longer than any line through the scene
  std::vector<ShadowEdge> edges_;
  DiscreteDistribution choice_;  // of an edge
  double list_seconds_ = 0;
};

}  // namespace limn
