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

// The up to `count` names with the fewest insertions, deletions and replacements of a character
// (Levenshtein's distance), the nearest first; ties in the order of `known`.
std::vector<std::string> nearest_names(const std::string& name, std::vector<std::string> known,
                                       size_t count);

// unknown TAG type "NAME" (known: A, B), and advice_on(name).
std::string unknown_type(const std::string& tag, const std::string& name,
                         const std::vector<std::string>& known);

// "; " and what to write in place of a type of Mitsuba's that limn lacks, or "".
std::string advice_on(const std::string& type);

}  // namespace limn
