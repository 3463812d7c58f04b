#pragma once
// The reverse pass over visible faces in place of samples.
#include "limn/integrators/backward.h"

namespace limn {

// As backward(), of the image that FacesEstimator makes: one term, `faces`, one batch, and no
// noise, so that standard errors are 0.
BackwardResult backward_over_faces(const Scene& scene, const Image& adjoint,
                                   const BackwardOptions& options, const RunSettings& settings);

}  // namespace limn
