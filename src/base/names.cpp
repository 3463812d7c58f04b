// Lists of known names in messages.
#include "limn/core/names.h"

namespace limn {

std::string join(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ", ") + word;
  return text;
}

std::string lower_case(std::string text) {
  for (char& c : text) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return text;
}

std::string unknown_name(const std::string& what, const std::string& name,
                         const std::vector<std::string>& known) {
  return "unknown " + what + " \"" + name + "\" (" + known_names(known) + ")";
}

std::string known_names(const std::vector<std::string>& known, const std::string& none) {
  return known.empty() ? none : "known: " + join(known);
}

}  // namespace limn
