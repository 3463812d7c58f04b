#pragma once
// The boundary term of a shading point: the silhouettes that it sees.
//   dL_o/dtheta  +=  sum over edges of the integral over t of dL(t) f_s(w_t) J(t) dt,   J(t) =
//   det(w_0, w_1, v) / |w|^3,
// some samples of it at every vertex of a path, averaged and weighed by the path's throughput.
#include "integrators/terms/edge_jump.h"
#include "limn/integrators/gradient.h"

namespace limn {

// Edges of all shapes (object i is shape i), light polygons and the environment's mean, as an edge
// sampler takes them.
EdgeSamplerInput make_sampler_input(const Scene& scene);

// Visitor of a PathTracer<Dual>. samples: at every vertex.
class ShadingBoundary {
 public:
  ShadingBoundary(const PathContext& context, const std::vector<EdgeMesh>& objects,
                  const EdgeSampler& sampler, int samples, TermCost& cost)
      : context_(context), objects_(objects), sampler_(sampler), samples_(samples), cost_(cost) {}

  void operator()(const SurfacePoint<Dual>& surface, const Scattering<Dual>& scattering,
                  const Rgb<Dual>& throughput, int bounces, const Rng& key);

  // Of all vertices so far, and of all samples at them: `samples` times the estimate.
  const Rgb<Lanes>& sum() const { return sum_; }

 private:
  void add_sample(const EdgeQuery& query, const Scattering<Dual>& scattering,
                  const Rgb<double>& throughput, int bounces, const Rng& key);

  const PathContext& context_;
  const std::vector<EdgeMesh>& objects_;
  const EdgeSampler& sampler_;
  int samples_;
  TermCost& cost_;
  Rgb<Lanes> sum_;
};

}  // namespace limn
