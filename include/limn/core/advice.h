#pragma once
// Messages about types of objects in scene files that limn lacks.
#include <string>
#include <vector>

namespace limn {

// unknown TAG type "NAME" (known: A, B), and advice_on(name).
std::string unknown_type(const std::string& tag, const std::string& name,
                         const std::vector<std::string>& known);

// "; " and what to write in place of a type of Mitsuba's that limn lacks, or "".
std::string advice_on(const std::string& type);

}  // namespace limn
