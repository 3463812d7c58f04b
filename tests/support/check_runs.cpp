// Runs of check with the tests' settings.
#include "support/check_runs.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <cmath>

namespace limn {

std::string suspected(const CheckResult& result) {
  return fmt::format("{}", fmt::join(result.suspects, " or "));
}

CheckResult run_check(const Scene& scene, const std::string& parameter, int spp,
                      const std::vector<std::string>& terms, const Method& method) {
  CheckOptions options;
  options.method = method;
  options.parameter = parameter;
  options.terms = terms;
  options.block = 4;
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 11;
  const CheckResult r = check(scene, options, settings);
  EXPECT_EQ(r.gradient.non_finite.count, 0u) << r.gradient.non_finite.message();
  EXPECT_EQ(r.differences.non_finite.count, 0u) << r.differences.non_finite.message();
  fmt::print(
      "{:28} {:3} blocks, mean z {:6.2f}, sd {:5.2f}, max |z| {:6.2f}; image {:10.4g} +- "
      "{:8.2g}, differences {:10.4g} +- {:8.2g}, z {:6.2f}\n",
      parameter.substr(0, parameter.find(':')), r.windows.count, r.windows.mean,
      r.windows.deviation, r.windows.largest, r.total.gradient, r.total.gradient_error,
      r.total.difference, r.total.difference_error, r.total.z);
  return r;
}

void expect_agreement(const Scene& scene, const std::string& parameter, int spp) {
  const CheckResult r = run_check(scene, parameter, spp);
  EXPECT_GT(r.windows.count, 0) << parameter;
  EXPECT_NE(r.verdict, Verdict::kDisagree) << parameter << ": suspect " << suspected(r);
}

std::vector<ReverseCheck> expect_modes_agree(const Scene& scene, int spp,
                                             const BackwardOptions& options) {
  RunSettings settings;
  settings.spp = spp;
  settings.seed = 3;
  std::vector<ReverseCheck> checks = check_reverse(scene, options, settings);
  for (const ReverseCheck& c : checks) {
    fmt::print("{:28} forward {:10.4g} +- {:8.2g}  reverse {:10.4g} +- {:8.2g}  z {:5.2f}\n",
               c.parameter, c.forward, c.forward_error, c.reverse, c.reverse_error, c.z);
    EXPECT_LT(std::fabs(c.z), 4.5) << c.parameter;
  }
  return checks;
}

}  // namespace limn
