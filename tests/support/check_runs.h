#pragma once
// Derivatives held against finite differences and reverse mode against forward mode, with what was
// found on the test's output.
#include <string>
#include <vector>

#include "limn/integrators/backward.h"
#include "limn/integrators/check.h"

namespace limn {

// "shadow", or "interior or boundary" where two terms explain what is wrong.
std::string suspected(const CheckResult& result);
// Uses blocks of four pixels; expects finite results.
CheckResult run_check(const Scene& scene, const std::string& parameter, int spp,
                      const std::vector<std::string>& terms = {},
                      const Method& method = Method(Task::kGradient));
// Expects some blocks and no disagreement in them.
void expect_agreement(const Scene& scene, const std::string& parameter, int spp);
// Checks every one of options.parameters.
std::vector<ReverseCheck> expect_modes_agree(const Scene& scene, int spp,
                                             const BackwardOptions& options);

}  // namespace limn
