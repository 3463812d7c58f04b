#pragma once
// A vertex of a path as edge samplers see it, and what a point on an edge adds there.
#include "integrators/terms/edge_difference.h"
#include "integrators/terms/mirror_sight.h"
#include "integrators/terms/seen_vertex.h"
#include "integrators/terms/term.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

EdgeQuery query_at(const PathVertex& vertex);
// Whether nothing that arrives at the vertex reaches the viewer, and so no edge adds anything.
bool is_unseen(const PathVertex& vertex);

// Replaces `drawn` by draws at a vertex of the path that `key` is of, `count` of them: draw i
// by the path's copy i.
void draw_edges(const EdgeSampler& sampler, const EdgeQuery& query, const Rng& key, int bounces,
                int count, std::vector<std::optional<EdgeSample>>& drawn);

// How a viewer sees a vertex that is no vertex of its path.
struct SeenAlong {
  Vec3d omega;  // unit, from the viewer
  double distance;
  const SeenVertex* viewer = nullptr;  // of the camera, which is the sink's; null: the sink's own
};

// By way of which flat mirrors a vertex sees an edge, and where its image in them is.
struct MirrorWay {
  const FlatMirrors::Chain& chain;
  Vec3d image;
};

// A point that was drawn on an edge, for a vertex.
struct EdgeDraw {
  const EdgeMesh& mesh;
  const EdgeSample& sample;
  RadiancePart part;                 // of the radiance beyond the edge
  Rng key;                           // of the path and the sample
  double share = 1;                  // that counts: others draw the point, too
  bool held = false;                 // the vertex sees the point in a direction that does not turn
  bool roulette = false;             // draws of little are left out by chance
  const SeenAlong* along = nullptr;  // null: the vertex is the sink's viewer
  const MirrorWay* way = nullptr;    // null: the vertex sees the edge itself
};

// Hands on what a point on an edge adds to the boundary integral at a vertex, over its density:
//   throughput dL(t) f_s det(w_0, w_1, v) / |w|^3 / (probability pdf_t),
// v the velocity of the point against the vertex and its directions. Books rays and what became of
// the sample.
void add_edge_point(const PathContext& context, const PathVertex& vertex, const EdgeDraw& draw,
                    BoundarySink& sink);

// To a face in the unit direction omega, at that distance, as shadow rays end.
Ray ray_to(const PathVertex& vertex, FaceRef face, const Vec3d& omega, double distance);
// Whether something hides the face from the vertex in the unit direction omega, at that distance.
// One shadow ray.
bool is_hidden_from(const PathContext& context, const PathVertex& vertex, FaceRef face,
                    const Vec3d& omega, double distance, TermCost& cost);

}  // namespace limn
