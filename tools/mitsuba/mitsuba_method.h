#pragma once
// Mitsuba 3's gradient of the same scene, from outside: as a method to compare with.
#include <map>
#include <memory>
#include <string>

#include "limn/integrators/timed_method.h"

namespace limn {

inline constexpr const char* kMitsuba = "mitsuba";
// The same, with its time beginning after its set-up (start, octree, pilot), which is told in its
// settings and not counted: what it does once all that is paid.
inline constexpr const char* kMitsubaAfterSetup = "mitsuba-after-setup";
bool is_mitsuba(const std::string& name);

// `name`: one of these two. `folder` takes the files that each run leaves behind for a moment.
// Every run throws MethodMissing where Mitsuba is not installed.
std::unique_ptr<TimedMethod> make_mitsuba_method(const std::string& name, const MethodInput& input,
                                                 const std::map<std::string, std::string>& defines,
                                                 const std::string& folder);

}  // namespace limn
