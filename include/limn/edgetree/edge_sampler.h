#pragma once
// Choosing an edge, and a point on it, for the boundary integral at a shading point p,
//   sum over e in E(p) of the integral over t in [0, 1] of dL(t) f_s(w_t) J(t) dt,
//   J = det(w_0, w_1, v) / |w|^3.
// The contract of those who choose; the table of them is edge_sampler_types.h.
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

// How the directions at a point move, per parameter.
struct DirectionTurn {
  // Their angular velocity; or, if there is an axis, the velocity of points that they follow over
  // the distance of these along it. All such points lie in a plane across the axis.
  Vec3<Lanes> rate{};
  Vec3d axis{};  // unit; or zero

  bool follows() const { return axis != Vec3d{}; }
  // |w| times the velocity of the direction of w, up to a part along w, which moves no edge: linear
  // in w.
  Vec3<Lanes> velocity(const Vec3d& w) const {
    return follows() ? rate * dot(axis, w) : cross(rate, w);
  }
};

// Everything about the shading point that a sampler may use.
struct EdgeQuery {
  Vec3d p;                 // world space
  Vec3d n;                 // unit normal of the scattering function, n.wi > 0
  Vec3d wi;                // unit, towards the viewer
  LobeSummary lobe;        // of the scattering function
  Vec3<Lanes> velocity{};  // of p, per parameter; an edge's velocity relative to p counts
  // An edge that moves as the directions at p do is at rest.
  DirectionTurn turn{};
  // The face that p lies on, if any: its edges lie on p's horizon, where the scattering function is
  // zero, and are never drawn.
  FaceRef face = {};
};

// Velocity of an edge's end, as seen from p: against p, and against the directions that turn. Along
// the edge it is linear in t.
inline Vec3<Lanes> relative_velocity(const EdgeMesh& mesh, VertexId vertex,
                                     const EdgeQuery& query) {
  const Vec3<Lanes> own = mesh.tangents.empty() ? Vec3<Lanes>{} : mesh.tangent(vertex);
  return own - query.velocity - query.turn.velocity(mesh.position(vertex) - query.p);
}

struct EdgeSample {
  EdgeRef edge;
  double t = 0;            // position on the edge: (1 - t) x_0 + t x_1
  double probability = 0;  // P(e), of this edge for this query
  double pdf_t = 0;        // density of t given the edge, per unit t
};

// What samplers are built from. It must outlive them.
struct EdgeSamplerInput {
  // Of the scene's shapes, in their order; then the curves where they cross, if any.
  std::vector<EdgeMesh> objects;
  // Pairs of shapes that touch and part, see TouchingMotion.
  std::vector<std::array<ShapeId, 2>> parting = {};
  std::vector<LightTriangle> lights = {};
  double environment_luminance = 0;  // mean over the sphere
  // How it is spread over directions; null if it is uniform or absent.
  std::shared_ptr<const RadiancePyramid> environment = nullptr;
  // Weights that make the speeds of different parameters comparable (a metre, a radian), for
  // importance only.
  Lanes lane_scale = {1, 1, 1, 1};

  const EdgeMesh& object(ShapeId id) const { return objects[id.index()]; }
};

// Whether the query's own face is among those around the edge.
inline bool is_own_edge(const EdgeSamplerInput& input, const EdgeQuery& query, EdgeRef id) {
  for (const FaceRef face : input.object(id.object).faces_around(id.edge))
    if (face == query.face) return true;
  return false;
}

// What a sampler holds beside its input.
struct SamplerSize {
  uint64_t nodes = 0;  // of its trees
  uint64_t bytes = 0;
};

// An edge with its ends, which are the floats of its mesh.
struct ListedEdge {
  EdgeRef id;
  Vec3d x0, x1;
};

class EdgeSampler {
 public:
  virtual ~EdgeSampler() = default;

  // Draws an edge of E(p) (never one of the query's own face) and a point on it. Nothing if the
  // draw ends without one; that happens with the probability that is missing from the sum of
  // `probability` over all edges, and counts as a sample of value zero. Thread-safe, no allocation
  // that grows per query.
  virtual std::optional<EdgeSample> sample(const EdgeQuery& query, Rng& rng) const = 0;

  // Replaces `samples` by one draw from every stream. The sum of any function over them has the mean
  // of as many draws by `sample`, and one stream alone gives its bits; but several may share their
  // work and be spread more evenly than independent ones, so that all must count alike.
  virtual void sample_several(const EdgeQuery& query, std::span<Rng> rngs,
                              std::vector<std::optional<EdgeSample>>& samples) const {
    samples.clear();
    for (Rng& rng : rngs) samples.push_back(sample(query, rng));
  }

  // P(e) for this query, without sampling: what `sample` reports when it returns this edge. Zero
  // only where the edge cannot contribute.
  virtual double probability(const EdgeQuery& query, EdgeRef edge) const = 0;
  // Density of t given the edge.
  virtual double pdf_t(const EdgeQuery& query, EdgeRef edge, double t) const = 0;

  // Appends every outline (see is_outline) that a part of may be seen from the query's point inside
  // the cone, above the horizon and in motion, but for those of the query's own face; some edges
  // outside may be among them. The order depends on the scene alone. False if this sampler lists
  // nothing. Thread-safe.
  virtual bool list_outlines(const EdgeQuery& /*query*/, const DirectionCone& /*cone*/,
                             std::vector<ListedEdge>& /*edges*/) const {
    return false;
  }

  // Time of a draw in units of one ray with the shading at its end, about 4 microseconds in scenes
  // of 20000 triangles, where it was timed. A figure and not a clock, so that what follows from it
  // is the same on every machine.
  virtual double draw_cost() const = 0;
  // What asking from a point takes beside its draws, however many these are, in the same unit.
  virtual double query_cost() const = 0;
  virtual SamplerSize size() const { return {}; }

  // The tree whose nodes this sampler rejects, for looking at; null if it rejects none. The sampler
  // must outlive it.
  virtual std::unique_ptr<RejectionTree> rejection_tree() const { return nullptr; }
};

}  // namespace limn
