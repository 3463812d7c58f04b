#pragma once
// Mitsuba 3's gradient of the same scene, from outside: as a method to compare with.
#include <map>
#include <memory>

#include "limn/integrators/derivative_method.h"

namespace limn {

inline constexpr const char* kMitsuba = "mitsuba";

// `folder` takes the files that each run leaves behind for a moment. Every run throws MethodMissing
// where Mitsuba is not installed.
std::unique_ptr<DerivativeMethod> make_mitsuba_method(
    const MethodInput& input, const std::map<std::string, std::string>& defines,
    const std::string& folder);

}  // namespace limn
