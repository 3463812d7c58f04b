#pragma once
// Planes through the point that light in closed form falls on.
#include <optional>
#include <utility>

#include "integrators/edges/edge_sides.h"
#include "limn/core/var.h"

namespace limn {

// (b - a) x (c - a) as three statements of the tape in place of fifteen: its derivative is
// da x (b - c) + db x (c - a) + dc x (a - b).
inline Vec3<Var> triangle_normal(const Vec3<Var>& a, const Vec3<Var>& b, const Vec3<Var>& c) {
  const Vec3d x = value(a), y = value(b), z = value(c);
  const Vec3d n = cross(y - x, z - x);
  if (is_constant(a) && is_constant(b) && is_constant(c)) return {n.x, n.y, n.z};
  Tape& tape = *Tape::current();
  const std::pair<const Vec3<Var>*, Vec3d> parts[] = {{&a, y - z}, {&b, z - x}, {&c, x - y}};
  Vec3<Var> normal;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    for (const auto& [corner, e] : parts) {
      tape.entry((*corner)[i].node, e[j]);
      tape.entry((*corner)[j].node, -e[i]);
    }
    normal[k] = {n[k], tape.end()};
  }
  return normal;
}

// Of the faces around an edge that rise above the start's own, which is what a point near the edge
// sees of them: the one that rises first leaves directions w with this . w >= 0.
inline std::optional<Vec3d> wedge_at(const Scene& scene, const RayTracer& tracer,
                                     const EdgeStart& edge, const Vec3d& up) {
  const Vec3d along = normalize(edge.x1 - edge.x0);
  const Vec3d& f = edge.start.into;
  const auto turn = [&](const Vec3d& a, const Vec3d& b) { return dot(along, cross(a, b)); };
  const double sign = turn(f, up) < 0 ? -1 : 1;
  std::optional<Vec3d> wedge;
  double nearest = -2;
  for_every_side(scene, edge.around, edge.x0, along, [&](const FaceSide& side, Incidence) {
    if (side.face == edge.start.face || overlap(tracer, side, edge.start)) return;
    if (!(sign * turn(f, side.into) > 0) || !(dot(f, side.into) > nearest)) return;
    nearest = dot(f, side.into);
    wedge = cross(along, side.into) * -sign;
  });
  return wedge;
}

}  // namespace limn
