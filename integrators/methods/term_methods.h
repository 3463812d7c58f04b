#pragma once
// Methods that work term by term: one for every edge sampler.
#include <vector>

#include "limn/integrators/methods.h"

namespace limn {

std::vector<MethodType> term_methods();

}  // namespace limn
