// Weights on nodes, ends of edges as nodes, and sweeps.
#include "integrators/backward/adjoint_context.h"

#include "limn/core/reverse.h"

namespace limn {

Vec3<Var> Seeds::end_of(const AdjointContext& context, EdgeRef id, int end) {
  return free_point(context, id, end);
}

Vec3<Var> Seeds::point_of(const AdjointContext& context, EdgeRef id, double t) {
  return free_point(context, id, t);
}

Vec3<Var> Seeds::free_point(const AdjointContext& context, EdgeRef id, double t) {
  const EdgeMesh& mesh = context.edges.object(id.object);
  const auto [a, b] = mesh.edge(id.edge).vertices;
  const Vec3d x = t == 0   ? mesh.position(a)
                  : t == 1 ? mesh.position(b)
                           : mesh.position(a) * (1 - t) + mesh.position(b) * t;
  Vec3<Var> point{x.x, x.y, x.z};
  if (!context.motion.moves(id)) return point;
  for (int k = 0; k < 3; ++k) point[k].node = Tape::current()->end();
  points_.push_back({id, t, point.x.node});
  return point;
}

void Seeds::sweep(const AdjointContext& context, Tape& tape) const {
  tape.start();
  for (const Node& seed : nodes_) tape.adjoint(seed.node) += seed.weight;
  tape.sweep();
  for (const EdgePoint& point : points_) {
    const Vec3d g{tape.adjoint(point.first), tape.adjoint(point.first + 1),
                  tape.adjoint(point.first + 2)};
    if (!(g == Vec3d{})) context.motion.contribute_point(tape, point.id, point.t, g);
  }
}

Var shadow_sweep(const AdjointContext& context, const ShadowEdge& edge, const ShadowPoint& point,
                 const Vec3<Var>& origin, const Vec3<Var>& direction, double distance,
                 Seeds& seeds) {
  const Vec3<Var> y0 = seeds.end_of(context, edge.id, 0), y1 = seeds.end_of(context, edge.id, 1);
  const Vec3<Var> light = light_origin(*edge.light);
  const Vec3<Var> w = edge.light->origin().infinite ? light : y0 - light;
  const auto x = surface_on_ray<Var>(context.scene(), point.face, origin, direction);
  const double cosine = std::fabs(dot(x.n_g, value(direction)));
  return dot(cross(w, y1 - y0), x.p - y0) * (point.m * cosine / (distance * distance));
}

}  // namespace limn
