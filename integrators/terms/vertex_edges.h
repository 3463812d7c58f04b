#pragma once
// A vertex of a path as edge samplers see it, and what a point on an edge adds there.
#include "integrators/terms/edge_jump.h"
#include "integrators/terms/term.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

EdgeQuery query_at(const PathVertex& vertex);

// The unit direction omega as directions of the path move at a vertex. Where they are warped, key
// is for what auxiliary rays draw, and `cost` gets these.
Vec3<Dual> moving_direction(const PathVertex& vertex, const Vec3d& omega, const Rng& key,
                            TermCost& cost);

// Replaces `drawn` by draws at a vertex of the path that `key` is of, as many as asked for: draw i
// by the path's copy i.
void draw_edges(const EdgeSampler& sampler, const EdgeQuery& query, const Rng& key, int bounces,
                int count, std::vector<std::optional<EdgeSample>>& drawn);

// Adds what a point on an edge contributes to the boundary integral at a vertex, over its density:
// throughput dL(t) f_s det(w_0, w_1, v) / |w|^3 / (probability pdf_t), v against directions that
// move. part: of the radiance; key: of the path and the sample; share: of what v is while
// directions are held; by_roulette: weak ones are traced by the vertex's `survival`. Books rays and
// what became of the sample on `cost`.
void add_edge_point(const PathContext& context, const EdgeMesh& mesh, const PathVertex& vertex,
                    const EdgeQuery& query, const EdgeSample& sample, const RadiancePart& part,
                    const Rng& key, TermCost& cost, Rgb<Lanes>& sum, double share = 1,
                    bool by_roulette = false);

// Whether something hides the face from the vertex in the unit direction omega, at that distance.
// One shadow ray.
template <class Vertex>
bool is_hidden_from(const PathContext& context, const Vertex& vertex, FaceRef face,
                    const Vec3d& omega, double distance, TermCost& cost) {
  Ray ray{value(vertex.surface.p), omega};
  ray.start = vertex.surface.face;
  ray.end = face;
  ray.t_max = distance * (1 - 0x1p-20);  // as shadow rays end
  cost.add(RayCount{0, 1});
  return context.tracer.occluded(ray);
}

}  // namespace limn
