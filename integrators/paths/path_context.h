#pragma once
// What paths are followed in, alike for all of them, and small things that all of them use.
#include "integrators/edges/flat_mirrors.h"
#include "integrators/edges/viewpoint.h"
#include "integrators/lights/closed_light.h"
#include "integrators/lights/mirrored_light.h"
#include "limn/core/lights.h"
#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"

namespace limn {

struct PathContext {
  const Scene& scene;
  const RayTracer& tracer;
  const Lights& lights;
  // Takes the place of all light that is scattered; null: paths are sampled.
  const ClosedLight* closed = nullptr;
  // From where edges are looked at; needed where paths start beside edges.
  const Viewpoints* viewpoints = nullptr;
  // What a share of directions is drawn from; null: none.
  const MirroredLight* mirrored = nullptr;
  // Of differences: the scene before it moved, by whose materials roulette is played; null: by the
  // throughput. Else what a material changes cancels in all paths that survive in both images, and
  // the whole derivative is in the few that survive in one, by much over the step.
  const Scene* unmoved = nullptr;
  // By way of which edges are seen; null where there are none, or no path starts beside an edge.
  const FlatMirrors* flat_mirrors = nullptr;
  // Whether edges are seen straight through surfaces (straight_way.h).
  bool straight_ways = false;
};

// Does nothing at path vertices.
struct NoVisitor {
  template <class... A>
  void operator()(const A&...) const {}
};

inline double mis_weight(double pdf, double other) {
  // Power heuristic; written so that huge densities do not overflow.
  const double ratio = other / pdf;
  return 1 / (1 + ratio * ratio);
}
// The same over pdf.
inline double mis_weight_over_pdf(double pdf, double other) {
  const double ratio = other / pdf;
  return 1 / ((1 + ratio * ratio) * pdf);
}

}  // namespace limn
