#pragma once
// The ways to a derivative image that limn has: one row each. `limn gradient`, `check` and
// `compare` take all of them, and know none by its name.
#include <functional>
#include <string>
#include <vector>

#include "limn/integrators/gradient.h"

namespace limn {

struct MethodType {
  std::string name;
  std::string description;
  std::vector<std::string> terms;  // what it can compute, in the order of --samples and all tables
  bool terms_can_be_left_out = false;
  // What terms hold by themselves depends on choices that the run makes; their sum does not.
  bool only_sum_fixed = false;
  bool closed_light = false;  // it takes GradientOptions::points
  bool warps = false;         // it takes GradientOptions::warp
  bool biased = false;        // its mean is not the derivative, however many samples it takes
  bool ablation = false;      // a variant that shows what a part of a method is worth
  // InputError, with the place, for a scene that the method cannot take; null: it takes all.
  void (*check)(const Scene&) = nullptr;
  std::function<GradientResult(const MethodType&, const Scene&, const GradientOptions&,
                               const RunSettings&)>
      run;
  // As trace_sample() in gradient.h; none for methods that cannot.
  std::function<std::vector<std::string>(const MethodType&, const Scene&, const GradientOptions&,
                                         const RunSettings&, const NonFinite::Place&)>
      trace = nullptr;
};

// The first is the default.
const std::vector<MethodType>& method_types();

// InputError if the options are not the defaults and none of the methods, by name, takes them.
void check_warp(const WarpOptions& warp, const std::vector<std::string>& methods);

// The default for ""; InputError that lists the known names if there is none of this name.
const MethodType& find_method(const std::string& name);

}  // namespace limn
