#pragma once
// The methods: a file of its own each, and one row. Included by methods.cpp, and by the methods.
#include "integrators/methods/term_methods.h"
#include "limn/integrators/methods.h"

namespace limn {

GradientResult run_differences(const MethodType& method, const Scene& scene,
                               const GradientOptions& options, const RunSettings& settings);

// Those beside one for every edge sampler.
inline std::vector<MethodType> other_methods() {
  return {{.name = "fd",
           .description = "central finite differences with common random numbers",
           .terms = {"differences"},
           .run = run_differences}};
}

}  // namespace limn
