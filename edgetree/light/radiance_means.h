#pragma once
// Means over the cones around several boxes at once.
#include "edgetree/simd.h"
#include "limn/edgetree/radiance_pyramid.h"

namespace limn {

// RadiancePyramid::mean lane by lane; any number where d or the tangent is none.
Floats means(const RadiancePyramid& pyramid, const Floats3& d, Floats tangent);

}  // namespace limn
