#pragma once
// The command line's side of the table of options (limn/integrators/options.h).
#include <CLI/CLI.hpp>
#include <functional>
#include <string>
#include <vector>

#include "limn/integrators/fit_options.h"
#include "limn/integrators/options.h"

namespace limn {

// How the command line spells a field: "--edge-samples" of "edge_samples".
std::string option_name(std::string field);

// Of the command line, whose spelling other options have there.
std::string help_of(const Option& option);
// A number in the row's range. Nothing else is, nor what is no number.
CLI::Validator within(const Option& option);
CLI::Validator within(long double least, long double most);

// Visits rows and adds an option for each, whose default is the field's value.
class OptionAdder {
 public:
  explicit OptionAdder(CLI::App& app) : app_(app) {}

  // Numbers, of the types that option_adder.cpp lists: CLI11 takes long to compile.
  template <class T>
  void operator()(T& value, const Option& option) const;
  void operator()(std::vector<std::string>& terms, const Option& option) const;
  void operator()(Method& method, const Option& option) const;
  template <Choice T>
  void operator()(T& value, const Option& option) const {
    add_choice(option, word_of(value, option),
               [&value, option](const std::string& word) { set_word(value, option, word); });
  }

 private:
  void add_choice(const Option& option, const std::string& standard,
                  const std::function<void(const std::string&)>& set) const;

  CLI::App& app_;
};

// Rows alone of this name.
auto only(const char* name, auto&& visit) {
  return [name = std::string(name), &visit](auto& field, const Option& option) {
    if (name == option.name) visit(field, option);
  };
}

// InputError if one of the options was given.
void refuse_options(const CLI::App& app, const std::vector<std::string>& names,
                    const std::string& why);
// The same, where faces have no use for them, of `names` and all rows that are of samples.
void refuse_samples(const CLI::App& app, FilmPoints points, std::vector<std::string> names,
                    const auto& options) {
  if (points != FilmPoints::kFaces) return;
  visit_options(options, [&](const auto&, const Option& option) {
    if (option.of_samples) names.push_back(option_name(option.name));
  });
  refuse_options(app, names, "--points faces takes no samples");
}
// InputError for options of images that none of the methods has.
void check_image_options(const CLI::App& app, const std::vector<Method>& methods);

}  // namespace limn
