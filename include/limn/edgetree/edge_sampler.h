#pragma once
// Edge samplers choose an edge, and a point on it, for the boundary integral at a shading point
// p,
// sum over e in E(p) of the integral over t in [0, 1] of dL(t) f_s(w_t) J(t) dt,
// with J = det(w_0, w_1, v) / |w|^3. edge_sampler_types.h has the table of samplers.
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "limn/core/lobe.h"
#include "limn/core/rng.h"
#include "limn/edgetree/direction_cone.h"
#include "limn/edgetree/edges.h"
#include "limn/edgetree/radiance_pyramid.h"
#include "limn/edgetree/rejection_tree.h"

namespace limn {

// Motion of the sampled directions at a point, per parameter.
struct DirectionTurn {
  // Angular velocity of the directions. If `axis` is set: the velocity of points in a plane across
  // the axis that the directions follow, divided by the distance of the plane along the axis.
  Vec3<Lanes> rate{};
  Vec3d axis{};  // unit; or zero

  bool follows() const { return axis != Vec3d{}; }
  // Velocity of the direction of w times |w|, up to a component along w, which moves no edge.
  // Linear in w.
  Vec3<Lanes> velocity(const Vec3d& w) const {
    return follows() ? rate * dot(axis, w) : cross(rate, w);
  }
};

// The shading point, as edge samplers see it.
struct EdgeQuery {
  Vec3d p;                 // world space
  Vec3d n;                 // unit normal of the scattering function, n.wi > 0
  Vec3d wi;                // unit, towards the viewer
  LobeSummary lobe;        // of the scattering function
  Vec3<Lanes> velocity{};  // of p, per parameter; edges move relative to it
  // Motion of the directions at p: an edge with the same motion is static.
  DirectionTurn turn{};
  // The face on which p lies, if any. Its edges lie on the horizon of p, where the scattering
  // function is zero, and are never sampled.
  FaceRef face = {};
};

// Velocity of an edge's end relative to p and to the motion of the directions there. Linear in t
// along the edge.
inline Vec3<Lanes> relative_velocity(const EdgeMesh& mesh, VertexId vertex,
                                     const EdgeQuery& query) {
  const Vec3<Lanes> own = mesh.tangents.empty() ? Vec3<Lanes>{} : mesh.tangent(vertex);
  return own - query.velocity - query.turn.velocity(mesh.position(vertex) - query.p);
}

struct EdgeSample {
  EdgeRef edge;
  double t = 0;            // position on the edge: (1 - t) x_0 + t x_1
  double probability = 0;  // P(e) for this query
  double pdf_t = 0;        // density given the edge, with respect to t
};

// The input of all samplers; it must outlive them.
struct EdgeSamplerInput {
  // Edges of the scene's shapes, in order; then the intersection curves, if any.
  std::vector<EdgeMesh> objects;
  // Pairs of shapes that touch and separate, see TouchingMotion.
  std::vector<std::array<ShapeId, 2>> parting = {};
  std::vector<LightTriangle> lights = {};
  double environment_luminance = 0;  // mean over the sphere
  // Its distribution over directions; null if uniform or absent.
  std::shared_ptr<const RadiancePyramid> environment = nullptr;
  // Weights that make speeds of different parameters comparable (metres, radians). They affect
  // importance only.
  Lanes lane_scale = {1, 1, 1, 1};

  const EdgeMesh& object(ShapeId id) const { return objects[id.index()]; }
};

// True if the query's own face is among those around the edge.
inline bool is_own_edge(const EdgeSamplerInput& input, const EdgeQuery& query, EdgeRef id) {
  for (const FaceRef face : input.object(id.object).faces_around(id.edge))
    if (face == query.face) return true;
  return false;
}

// Size of a sampler's own data.
struct SamplerSize {
  uint64_t nodes = 0;  // of its trees
  uint64_t bytes = 0;
};

// An edge with its end points, equal to the floats of its mesh.
struct ListedEdge {
  EdgeRef id;
  Vec3d x0, x1;
};

class EdgeSampler {
 public:
  virtual ~EdgeSampler() = default;

  // Samples an edge of E(p) (never one of the query's own face) and a point on it. Nothing if the
  // draw is rejected. Rejection has the probability that is missing from the sum of `probability`
  // over all edges, and counts as a sample of value zero. Thread-safe; allocations do not grow with
  // queries.
  virtual std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const = 0;

  // Replaces `samples` by one draw per stream. A sum over them has the same mean as over separate
  // draws; a single stream gives the same bits as `sample`. Draws may share work and be stratified,
  // so all must be weighted equally.
  virtual void sample_several(const EdgeQuery& query, std::span<Rng> rngs,
                              std::vector<std::optional<EdgeSample>>& samples) const {
    samples.clear();
    for (Rng& rng : rngs) samples.push_back(sample(query, rng));
  }

  // P(e) for this query, as `sample` reports it for this edge. Zero only where the edge cannot
  // contribute.
  virtual double probability(const EdgeQuery& query, EdgeRef edge) const = 0;
  // Density of t given the edge.
  virtual double pdf_t(const EdgeQuery& query, EdgeRef edge, double t) const = 0;

  // Appends every outline (see is_outline) that may be visible from the query's point inside of the
  // cone, above the horizon, and moves, except those of the query's own face. Conservative: may
  // include edges outside. The order depends on the scene alone. False if this sampler does not
  // support it. Thread-safe.
  virtual bool list_outlines(const EdgeQuery& /*query*/, const DirectionCone& /*cone*/,
                             std::vector<ListedEdge>& /*edges*/) const {
    return false;
  }

  // Cost of a draw in units of a ray with its shading, about 4 microseconds in scenes of 20000
  // triangles, where it was measured. A constant, not a clock, so that results are the same on
  // every machine.
  virtual double draw_cost() const = 0;
  // Cost of a query in addition to its draws, in the same unit.
  virtual double query_cost() const = 0;
  virtual SamplerSize size() const { return {}; }

  // The tree whose nodes this sampler rejects, for inspection; null if it rejects none. The sampler
  // must outlive it.
  virtual std::unique_ptr<RejectionTree> rejection_tree() const { return nullptr; }
};

}  // namespace limn
