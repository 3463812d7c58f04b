#pragma once
// A tracer that tests every face in double precision: the reference for Embree.
#include <memory>

#include "limn/core/ray_tracer.h"

namespace limn {

// The scene must outlive it.
std::unique_ptr<RayTracer> make_brute_force_tracer(const Scene& scene);

}  // namespace limn
