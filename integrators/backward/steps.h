#pragma once
// Gradients of the steps of a fit, which keep what earlier steps have made.
#include "integrators/edges/scene_edges.h"
#include "limn/integrators/backward.h"

namespace limn {

// As backward(), with what `kept` has of other steps.
BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings, KeptEdges& kept);

}  // namespace limn
