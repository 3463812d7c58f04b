#pragma once
// Builds the paper's forest.
#include "edgetree/quadric/quadric_config.h"
#include "edgetree/quadric/quadric_node.h"
#include "limn/edgetree/edge_sampler.h"

namespace limn {

// Builds one tree per object and group with edges. The result does not depend on `threads`.
QuadricForest build_quadric_forest(const EdgeSamplerInput& input, int threads,
                                   const QuadricConfig& config);

}  // namespace limn
