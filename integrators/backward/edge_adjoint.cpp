// Points on edges push the edges' ends and the vertices that see them.
#include "integrators/backward/edge_adjoint.h"

#include <limits>

#include "limn/core/reverse.h"

namespace limn {

EdgeQuery query_at(const AdjointVertex& vertex) {
  EdgeQuery query;
  query.p = value(vertex.surface.p);
  query.n = value(vertex.scattering.normal());
  query.wi = value(vertex.scattering.wi());
  query.lobe = vertex.scattering.bsdf().lobe();
  if (!is_still(vertex.surface.p)) {
    query.velocity = {{-1, 0, 0, 0}, {0, -1, 0, 0}, {0, 0, -1, 0}};
  }
  query.face = vertex.surface.face;
  return query;
}

// The velocity v of the edge's point, less that of p, sweeps over directions at the rate
// v . side / |w|^3.
void add_edge_point(const AdjointContext& context, const AdjointVertex& vertex,
                    const EdgeQuery& query, const EdgeSample& sample, const RadiancePart& part,
                    const Rng& key, double share, Tape& tape, Seeds& seeds, TermCost& cost) {
  const EdgeMesh& mesh = context.edges.object(sample.edge.object);
  EdgeView view;
  const bool seen = view_edge(mesh, sample.edge, sample.t, query.p, view);
  const bool moves =
      share > 0 && (context.motion.moves(sample.edge) || !is_still(vertex.surface.p));
  const Rgb<double> f =
      seen && moves && sample.pdf_t > 0 ? vertex.scattering.eval_value(view.omega) : Rgb<double>{};
  if (is_black(f)) {
    ++cost.zero_weight;
    return;
  }
  RayCount rays;
  Rgb<double> jump;
  const bool visible =
      edge_jump(context.path, mesh, view, query.face, 0, std::numeric_limits<double>::infinity(),
                vertex.bounces + 1, key, rays, jump, part);
  cost.add(rays);
  if (!visible) {
    ++cost.occluded;
    return;
  }
  ++cost.counted;
  const double measure =
      1 / (view.distance * view.distance * view.distance * sample.probability * sample.pdf_t);
  const Vec3d g = view.side * (weighed(vertex.weight, f * jump) * measure * share);
  if (g == Vec3d{}) return;
  if (context.motion.moves(sample.edge)) {
    context.motion.contribute_point(tape, sample.edge, sample.t, g);
  }
  seeds.add(vertex.surface.p, -g);
}

void add_penumbra_line(const AdjointContext& context, const DrawnLine& drawn,
                       const Vec3<Var>& origin, const Vec3<Var>& direction,
                       const Rgb<double>& weight, int bounces, const Rng& key, Tape& tape,
                       Seeds& seeds, TermCost& cost) {
  const auto surface = surface_on_ray<Var>(context.scene(), drawn.face, origin, direction);
  const Scattering<Var> scattering(surface, -direction, context.scene().shading);
  if (scattering.black()) return;
  const AdjointVertex vertex{surface, scattering, weight, bounces};
  const RadiancePart part{&context.regions->regions, drawn.line.region};
  add_edge_point(context, vertex, query_at(vertex), drawn.edge, part, key, 1, tape, seeds, cost);
}

}  // namespace limn
