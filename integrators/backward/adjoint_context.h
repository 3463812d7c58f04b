#pragma once
// What all samples of a reverse pass share.
#include <array>
#include <memory>
#include <vector>

#include "integrators/backward/edge_motion.h"
#include "integrators/backward/parameter_slots.h"
#include "integrators/paths/path.h"
#include "integrators/terms/camera_edges.h"
#include "integrators/terms/direct_edges.h"
#include "integrators/terms/penumbra_lines.h"
#include "integrators/terms/shadow_edges.h"
#include "limn/edgetree/edge_sampler.h"
#include "limn/integrators/run.h"

namespace limn {

// The terms of a reverse pass, in the order of results.
enum AdjointTerm { kInterior, kCamera, kBoundary, kShadow, kDirect, kPenumbra, kAdjointTerms };

// What stands in for regions of light where a sampler keeps them apart.
struct AdjointRegions {
  const LightRegions& regions;
  const LampEdges& lamp_edges;
  DirectEdges direct;
  PenumbraLines lines;
};

struct AdjointContext {
  const PathContext& path;
  const ParameterSlots& parameters;
  const EdgeSamplerInput& edges;
  EdgeMotion motion;
  FilterTable filter;
  // Null where the term is not computed.
  const EdgeSampler* sampler = nullptr;
  const CameraEdges* camera = nullptr;
  const ShadowEdges* shadows = nullptr;
  // Null where there are none; whether their terms are computed.
  const AdjointRegions* regions = nullptr;
  bool direct = false, penumbra = false;
  bool interior = true;
  int edge_samples = 1;

  const Scene& scene() const { return path.scene; }
  // Of what arrives, what `boundary` holds.
  RadiancePart rest() const { return {regions ? &regions->regions : nullptr}; }
};

using AdjointCosts = std::array<TermCost, kAdjointTerms>;

// Puts weights on nodes of the tape and sweeps; then hands on what the ends of edges got, which
// stand for themselves on the tape as free nodes.
class Seeds {
 public:
  void add(uint32_t node, double weight) {
    if (node != 0) nodes_.push_back({node, weight});
  }
  void add(const Vec3<Var>& v, const Vec3d& weight) {
    for (int k = 0; k < 3; ++k) add(v[k].node, weight[k]);
  }
  // An end of an edge as three new nodes, or as a constant where nothing moves it.
  Vec3<Var> end_of(const AdjointContext& context, EdgeRef id, int end);
  // A point of the edge, at t.
  Vec3<Var> point_of(const AdjointContext& context, EdgeRef id, double t);

  bool empty() const { return nodes_.empty(); }
  void sweep(const AdjointContext& context, Tape& tape) const;

 private:
  struct Node {
    uint32_t node;
    double weight;
  };
  struct EdgePoint {
    EdgeRef id;
    double t;
    uint32_t first;  // of its three nodes
  };
  Vec3<Var> free_point(const AdjointContext& context, EdgeRef id, double t);

  std::vector<Node> nodes_;
  std::vector<EdgePoint> points_;
};

// dL_k/dtheta where shadows' edges sweep over what a viewer sees: the node of G of
// shadow_boundary.cpp as a statement. origin, direction: of the viewer's ray; distance: along it.
Var shadow_sweep(const AdjointContext& context, const ShadowEdge& edge, const ShadowPoint& point,
                 const Vec3<Var>& origin, const Vec3<Var>& direction, double distance,
                 Seeds& seeds);

}  // namespace limn
