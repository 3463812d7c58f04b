#pragma once
// A vertex of a path as edge samplers see it.
#include "integrators/terms/term.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

inline EdgeQuery query_at(const PathVertex& vertex) {
  const Vec3<Dual>& p = vertex.surface.p;
  EdgeQuery query;
  query.p = value(p);
  query.n = value(vertex.scattering.normal());
  query.wi = value(vertex.scattering.wi());
  query.lobe = vertex.scattering.bsdf().lobe();
  query.velocity = {p.x.d, p.y.d, p.z.d};
  query.turn = vertex.turn;
  query.face = vertex.surface.face;
  return query;
}

}  // namespace limn
