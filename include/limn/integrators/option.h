#pragma once
// One row of the table of options (options.h): what it allows, and the words of its choices.
#include <algorithm>
#include <concepts>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "limn/integrators/method.h"

namespace limn {

// One row. A help text names other options as `edge_samples`, and ends without a full stop.
struct Option {
  const char* name;  // in Python and JSON; of the command line with "--", and "-" for "_"
  const char* help;
  long double least = 0, most = 0;       // a closed range of numbers; none if both are 0
  std::span<const char* const> words{};  // of choices, by their numbers
  const char* unset = nullptr;           // what 0, which is then allowed too, stands for
  const char* type = nullptr;            // what a command line's help calls the value
  const char* flag = nullptr;            // the name as a truth value: of the second word
  Task task = Task::kGradient;           // of a method, or of the terms
  bool of_samples = false;               // refused where points of the film take no samples

  template <class T>
  constexpr Option with(T Option::*field, T value) const {
    Option row = *this;
    row.*field = value;
    return row;
  }
  constexpr Option or_zero(const char* what) const { return with(&Option::unset, what); }
  constexpr Option typed(const char* what) const { return with(&Option::type, what); }
  constexpr Option samples() const { return with(&Option::of_samples, true); }
};

// Rows of common kinds.
constexpr Option choice(const char* name, std::span<const char* const> words, const char* help) {
  return {name, help, 0, 0, words};
}
constexpr Option method_option(Task task) {
  return Option{"method", "Method, by its name"}.with(&Option::task, task);
}
constexpr Option terms_option(Task task) {
  return Option{"terms", "Terms to compute (default: all that the scene has)"}.with(&Option::task,
                                                                                    task);
}
constexpr Option step_option(const char* help) {
  return Option{"step", help, 1e-12L, 1e12L}.or_zero("a pilot finds it");
}

template <class T, class Options>
concept Like = std::same_as<std::remove_const_t<T>, Options>;
// What is named by a word.
template <class T>
concept Choice = std::is_enum_v<T> || std::same_as<T, bool> || std::same_as<T, std::string>;

// The number of a word among those of the row; InputError that lists them.
size_t number_of(const Option& option, const std::string& word);

std::string word_of(const Choice auto& value, const Option& option) {
  if constexpr (std::same_as<std::remove_cvref_t<decltype(value)>, std::string>) {
    return value;
  } else {
    return option.words[static_cast<size_t>(value)];
  }
}
template <Choice T>
void set_word(T& value, const Option& option, const std::string& word) {
  const size_t number = number_of(option, word);
  if constexpr (std::same_as<T, std::string>) {
    value = word;
  } else {
    value = static_cast<T>(number);
  }
}

// The one check of ranges: "" or what is wrong with a number, as "7 is not a number from 1 to 5".
std::string range_error(const std::string& number, long double value, const Option& option);
std::string range_text(const Option& option);  // "1 to 5"
// FieldError unless the row allows the number, or all numbers.
struct CheckRange {
  void operator()(double value, const Option& option) const;
  void operator()(const std::vector<int64_t>& values, const Option& option) const {
    for (const int64_t value : values) (*this)(static_cast<double>(value), option);
  }
  void operator()(const std::optional<int>& value, const Option& option) const {
    if (value) (*this)(*value, option);
  }
  template <class T>
  void operator()(const T& /*no number*/, const Option& /*option*/) const
      requires(!std::convertible_to<T, double> || Choice<T>) {}
};
void check_options(const auto& options) { visit_options(options, CheckRange()); }

// visit, but not for the rows of these names.
auto all_but(std::initializer_list<const char*> names, auto&& visit) {
  return [names = std::vector<std::string>(names.begin(), names.end()), &visit](
             auto& field, const Option& option) {
    if (std::find(names.begin(), names.end(), option.name) == names.end()) visit(field, option);
  };
}

}  // namespace limn
