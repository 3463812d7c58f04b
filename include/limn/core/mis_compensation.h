#pragma once
// Draws of an environment beside those of scattering (MIS compensation).
#include <memory>

#include "limn/core/environment.h"

namespace limn {

// The environment, with directions drawn from what is brighter than its mean (environment_map.h):
// for users who combine them with scattering's by multiple importance sampling. An environment
// without a map is left as it is.
std::shared_ptr<Environment> mis_compensated(const std::shared_ptr<Environment>& environment);

}  // namespace limn
