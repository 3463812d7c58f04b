#pragma once
// The choice of a shading model.
#include "limn/core/scene.h"

namespace limn {

// Sets Scene::shading, and how materials use normals of maps (Bsdf::set_mitsuba_shading).
void set_shading(Scene& scene, ShadingModel model);

}  // namespace limn
