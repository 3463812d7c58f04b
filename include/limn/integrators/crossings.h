#pragma once
// Lines where surfaces cross each other: radiance jumps there too, and no edge carries that jump.
#include <cstdint>

#include "limn/core/ray_tracer.h"
#include "limn/core/scene.h"

namespace limn {

struct Crossings {
  uint64_t edges = 0;        // edges that pass through a face of another part of the surface
  ShapeId shape_a, shape_b;  // of the first one found
};

// Two triangles cross if and only if an edge of one passes through the other (but for measure
// zero), so every edge is traced as a ray.
Crossings find_crossings(const Scene& scene, const RayTracer& tracer);

}  // namespace limn
