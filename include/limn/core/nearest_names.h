#pragma once
// Suggestions for a mistyped name.
#include <string>
#include <vector>

namespace limn {

// The up to `count` names with the fewest insertions, deletions and replacements of a character
// (Levenshtein's distance), the nearest first; ties in the order of `known`.
std::vector<std::string> nearest_names(const std::string& name, std::vector<std::string> known,
                                       size_t count);

}  // namespace limn
