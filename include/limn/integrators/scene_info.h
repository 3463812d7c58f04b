#pragma once
// What a scene holds, and what can be differentiated, as JSON: of `limn info` and limn.info.
#include <string>

#include "limn/core/scene.h"

namespace limn {

// {"scene": file, "shapes": [...], "lights": [...], "sensors": [...], "crossings": {...},
// "parameters": [...]}.
std::string scene_info(const Scene& scene, int threads);

}  // namespace limn
