#pragma once
// A scene's edges as edge samplers take them.
#include <string>
#include <vector>

#include "limn/core/scene.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Edges of all shapes (object i is shape i), united where they touch, after them the curves where
// surfaces cross (if any do), light polygons and the environment's mean. The result does not depend
// on `threads`. Edges of textures come last, an object for each shape that has some.
EdgeSamplerInput make_sampler_input(const Scene& scene, int threads);
// The same in two steps: all but light polygons and the environment over directions; and these.
EdgeSamplerInput make_scene_edges(const Scene& scene, int threads);
void add_light(const Scene& scene, EdgeSamplerInput& input);

// One for each pair of shapes that touch and move towards each other or apart (ContactLine); none
// twice. edges: of the scene, in motion; null: none.
void warn_of_contacts(const Scene& scene, const EdgeSamplerInput* edges,
                      std::vector<std::string>& warnings);

}  // namespace limn
