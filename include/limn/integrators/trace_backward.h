#pragma once
// One sample of reverse mode, done again, for reading.
#include <string>
#include <vector>

#include "limn/integrators/backward.h"

namespace limn {

// As trace_sample() of gradient.h: one path of a pixel (x >= 0), by the number that the run gave
// it, or one of a term's points on the film, with what it adds to every parameter. settings: those
// of the run, without a limit of time. InputError if the run has no such sample.
std::vector<std::string> trace_backward(const Scene& scene, const Image& adjoint,
                                        const BackwardOptions& options, const RunSettings& settings,
                                        const NonFinite::SampleId& place);

}  // namespace limn
