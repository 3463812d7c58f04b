#pragma once
// The error of differences that comes from rounding moved positions and texels to float.
#include "limn/core/parameter.h"
#include "limn/core/scene.h"

namespace limn {

// The least step that floats resolve, with an error of 2^-10 of the way; 0 if neither vertices nor
// texels move.
double least_step(const Scene& scene, const Parameter& parameter);

// The error that rounding causes in differences at a step, over the derivative: about 2^-24 of what
// moves over its way. 0 if none of these moves.
double rounding_of_moves(const Scene& scene, const Parameter& parameter, double step);

// A power of two of at least the spacing of floats where they are widest, near the natural step:
// floats hold positions that move by it.
double resolved_step(const Scene& scene, const Parameter& parameter);

double power_of_two_below(double step);

}  // namespace limn
