#pragma once
// The method `analytic` over visible faces in place of samples.
#include "limn/integrators/gradient.h"

namespace limn {

// Of an image that FacesEstimator makes: one term, `faces`.
GradientResult run_faces(const Scene& scene, const GradientOptions& options,
                         const RunSettings& settings);

// As trace_sample() in gradient.h.
std::vector<std::string> trace_faces(const Scene& scene, const GradientOptions& options,
                                     const NonFinite::SampleId& place);

}  // namespace limn
