#pragma once
// Building the trees of the edge forest.
#include "edgetree/forest/forest_config.h"
#include "edgetree/forest/forest_node.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// One tree per object and group that has edges. The result does not depend on `threads`.
Forest build_forest(const EdgeSamplerInput& input, int threads, const ForestConfig& config);

}  // namespace limn
