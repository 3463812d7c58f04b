#pragma once
// Lists of known names, and messages about unknown ones.
#include <string>
#include <vector>

namespace limn {

// "a, b, c"
std::string join(const std::vector<std::string>& words);

// Converts A to Z to lower case; leaves other characters unchanged.
std::string lower_case(std::string text);

// The names of a table's rows (any type with a `name`), in order.
template <class Rows>
std::vector<std::string> names_of(const Rows& rows) {
  std::vector<std::string> names;
  for (const auto& row : rows) names.emplace_back(row.name);
  return names;
}

// unknown WHAT "NAME" (known: A, B)
std::string unknown_name(const std::string& what, const std::string& name,
                         const std::vector<std::string>& known);

// known: A, B   -- or `none` where there are none.
std::string known_names(const std::vector<std::string>& known,
                        const std::string& none = "none are known");

}  // namespace limn
