// Settings of rows, by their names.
#include "limn/core/settings.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

namespace limn {

void Settings::add(const Settings& others) {
  list_.insert(list_.end(), others.list_.begin(), others.list_.end());
}

const std::string& Settings::operator[](const std::string& name) const {
  for (const Setting& setting : list_) {
    if (setting.name == name) return setting.value();
  }
  throw std::logic_error("no setting \"" + name + "\"");
}

void Settings::choose(const std::string& owner, const std::string& text) {
  const size_t equals = text.find('=');
  const std::string name = text.substr(0, equals);
  const auto found =
      std::find_if(list_.begin(), list_.end(), [&](const Setting& s) { return s.name == name; });
  if (found == list_.end()) {
    throw InputError("\"" + owner + "\" has no setting \"" + name + "\" (" +
                     known_names(names_of(list_), "it has none") + ")");
  }
  const std::string value = equals == text.npos ? "" : text.substr(equals + 1);
  const auto place = std::find(found->values.begin(), found->values.end(), value);
  if (place == found->values.end()) {
    throw InputError("\"" + owner + "\": the setting " + name + " is one of " +
                     join(found->values) + ", not \"" + value + "\"");
  }
  if (found->chosen > 0) throw InputError("\"" + owner + "\": " + name + " is given twice");
  found->chosen = static_cast<size_t>(place - found->values.begin());
}

void Settings::copy_from(const Settings& others) {
  for (Setting& setting : list_) {
    for (const Setting& other : others.list_) {
      if (other.name == setting.name) setting.chosen = other.chosen;
    }
  }
}

std::string Settings::text() const {
  std::string text;
  for (const Setting& setting : list_) {
    if (setting.chosen > 0) text += ":" + setting.name + "=" + setting.value();
  }
  return text;
}

std::vector<std::string> split_name(const std::string& name) {
  std::vector<std::string> parts;
  std::stringstream stream(name);
  for (std::string part; std::getline(stream, part, ':');) parts.push_back(part);
  if (name.empty() || name.back() == ':') parts.emplace_back();
  return parts;
}

}  // namespace limn
