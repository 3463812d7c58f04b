#pragma once
// Rows of tables that leave choices open. A name may carry them: "forest:width=4:look-ahead=none"
// is the row `forest` with two of its settings changed.
#include <initializer_list>
#include <string>
#include <vector>

#include "limn/core/error.h"
#include "limn/core/names.h"

namespace limn {

struct Setting {
  std::string name, description;
  std::vector<std::string> values;  // the first is the default
  size_t chosen = 0;

  const std::string& value() const { return values[chosen]; }
};

class Settings {
 public:
  Settings() = default;
  Settings(std::initializer_list<Setting> list) : list_(list) {}

  const std::vector<Setting>& list() const { return list_; }
  void add(const Settings& others);
  // The value of a setting; it must be there.
  const std::string& operator[](const std::string& name) const;
  bool on(const std::string& name) const { return (*this)[name] == "on"; }
  // Takes "NAME=VALUE". InputError, which names the row `owner`, for a setting or a value that is
  // not there, with a list of those that are, and for a setting that is given twice.
  void choose(const std::string& owner, const std::string& text);
  // Takes the values of the settings that both have.
  void copy_from(const Settings& others);
  // ":width=4" of all that differs from the defaults, in the order of the list.
  std::string text() const;

 private:
  std::vector<Setting> list_;
};

// The parts of "a:b:c".
std::vector<std::string> split_name(const std::string& name);

// A copy of the row that `name` states, with its settings applied and listed in its name.
// InputError where there is no such row or setting. what: kind of the rows.
template <class Rows>
auto find_row(const std::string& what, const std::string& name, const Rows& rows) {
  const std::vector<std::string> parts = split_name(name);
  for (const auto& known : rows) {
    if (known.name != parts[0]) continue;
    auto row = known;
    for (size_t i = 1; i < parts.size(); ++i) row.settings.choose(row.name, parts[i]);
    row.name += row.settings.text();
    return row;
  }
  throw InputError(unknown_name(what, parts[0], names_of(rows)));
}

// The names of a row with one of its settings at a value that is not the default, for each.
template <class Row>
std::vector<std::string> variants_of(const Row& row) {
  std::vector<std::string> names;
  for (const Setting& setting : row.settings.list()) {
    for (size_t v = 1; v < setting.values.size(); ++v) {
      names.push_back(row.name + ":" + setting.name + "=" + setting.values[v]);
    }
  }
  return names;
}

}  // namespace limn
