#pragma once
// Which terms a run computes.
#include <string>
#include <vector>

namespace limn {

// `chosen`, or all if none is chosen. InputError that lists `known` for a name that is not among
// them. file: of the scene.
std::vector<std::string> selected_terms(const std::vector<std::string>& known,
                                        const std::vector<std::string>& chosen,
                                        const std::string& file);

}  // namespace limn
