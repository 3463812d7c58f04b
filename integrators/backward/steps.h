#pragma once
// Losses and gradients of the steps of a fit, which keep what earlier steps have made.
#include <vector>

#include "integrators/edges/scene_edges.h"
#include "limn/integrators/backward.h"

namespace limn {

// Two independent estimates of an image, each crop_height by crop_width by 3.
struct ImagePair {
  std::vector<double> a, b;
  std::vector<double> variances;  // of the sums of both
};
// As image_loss(), but for spp. All arguments are valid.
LossResult pair_loss(const Scene& scene, const Image& target, const LossOptions& options,
                     const ImagePair& pair, const Image& mask);

// As backward(), with what `kept` has of other steps.
BackwardResult backward(const Scene& scene, const Image& adjoint, const BackwardOptions& options,
                        const RunSettings& settings, KeptEdges& kept);

}  // namespace limn
