#pragma once
// A scene's edges as edge samplers take them.
#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Edges of all shapes (object i is shape i), united where they touch, light polygons and the environment's mean.
EdgeSamplerInput make_sampler_input(const Scene& scene, int threads);

}  // namespace limn
