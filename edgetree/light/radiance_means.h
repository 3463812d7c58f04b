#pragma once
// Means over the cones around several boxes (SIMD).
#include "edgetree/simd.h"
#include "limn/edgetree/radiance_pyramid.h"

namespace limn {

// RadiancePyramid::mean element-wise; unspecified where d or the tangent is invalid.
Floats means(const RadiancePyramid& pyramid, const Floats3& d, Floats tangent);

}  // namespace limn
