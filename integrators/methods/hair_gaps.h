#pragma once
// Gaps between shapes, and between faces of one, that are too narrow for a run's samples.
#include <string>
#include <vector>

#include "limn/core/scene.h"

namespace limn {

// A warning for each pair of shapes, or shape by itself, whose faces lie along each other with a
// gap so narrow that, with `spp` samples per pixel, all of it is met by less than one, if it faces
// the camera. Its part in a derivative is then missing from the standard error, too: the two sides
// of a gap of width g move what is seen in it over by 1 / g, however small g is. Gaps within what
// rounding of positions explains are none: such faces touch. Nor is the thickness of a shape one,
// where its surface is closed, with its normals outwards.
void warn_of_hair_gaps(const Scene& scene, double spp, int threads,
                       std::vector<std::string>& warnings);

}  // namespace limn
