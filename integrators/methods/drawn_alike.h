#pragma once
// Materials that differ between scenes, but draw the same directions.
#include <span>

#include "limn/core/scene.h"

namespace limn {

// The materials of `scenes` that differ between two of these draw directions from the mean of those
// two, with its density. Differences of images then have the noise of what the materials scatter.
// Where each drew its own directions, they would meet different edges and lights in a few samples,
// by much over the step. The scenes differ in values of materials alone.
void draw_alike(std::span<Scene> scenes, size_t first, size_t second);
// All draw as `unmoved` does, by the same random numbers: they follow its paths.
void draw_as(std::span<Scene> scenes, const Scene& unmoved);

}  // namespace limn
