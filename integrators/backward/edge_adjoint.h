#pragma once
// What points on edges add to a gradient as vertices of paths see them.
#include "integrators/backward/adjoint_context.h"
#include "integrators/terms/edge_jump.h"

namespace limn {

inline double weighed(const Rgb<double>& adjoint, const Rgb<double>& value) {
  return adjoint.r * value.r + adjoint.g * value.g + adjoint.b * value.b;
}

// A vertex of a path, and what its radiance weighs: adjoint times throughput over samples.
struct AdjointVertex {
  const SurfacePoint<Var>& surface;
  const Scattering<Var>& scattering;
  Rgb<double> weight;
  int bounces;
};

// The vertices of all that moves have unit tangents along the axes, the vertex their opposites, if
// it moves, so that an edge never seems to rest beside it.
EdgeQuery query_at(const AdjointVertex& vertex);

// Pushes the ends of the edge by contributions to the tape, and the vertex by `seeds`. part: of the
// radiance; key: of the path and the sample; share: of the whole.
void add_edge_point(const AdjointContext& context, const AdjointVertex& vertex,
                    const EdgeQuery& query, const EdgeSample& sample, const RadiancePart& part,
                    const Rng& key, double share, Tape& tape, Seeds& seeds, TermCost& cost);

// What a line from a lamp adds where the ray from a viewer meets its end; its density is complete.
void add_penumbra_line(const AdjointContext& context, const DrawnLine& drawn,
                       const Vec3<Var>& origin, const Vec3<Var>& direction,
                       const Rgb<double>& weight, int bounces, const Rng& key, Tape& tape,
                       Seeds& seeds, TermCost& cost);

}  // namespace limn
