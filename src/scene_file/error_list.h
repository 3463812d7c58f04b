#pragma once
// Errors of one scene file that do not follow from each other.
#include <string>
#include <vector>

#include "limn/core/error.h"

namespace limn {

// Several errors as one. what() has a line for each, in the order in which they were found, and
// their count where there are two or more. Without lines: an object needs one that failed, whose
// errors are already reported.
class InputErrors final : public InputError {
 public:
  explicit InputErrors(std::vector<std::string> lines = {});

  const char* what() const noexcept override { return text_.c_str(); }
  const std::vector<std::string>& lines() const { return lines_; }

 private:
  std::vector<std::string> lines_;
  std::string text_;
};

class ErrorList {
 public:
  // Runs `step` and keeps the InputError that it may throw, a repeated one once. Returns whether it
  // threw none. A full list (20) throws all its errors, also out of nested calls of keep().
  template <class Step>
  bool keep(const Step& step) {
    try {
      step();
      return true;
    } catch (const InputError& error) {
      if (is_full()) throw;
      add(error);
      if (is_full()) throw_any();
      return false;
    }
  }

  bool empty() const { return lines_.empty(); }

  // Throws InputErrors unless the list is empty.
  void throw_any() const;

 private:
  bool is_full() const;
  void add(const InputError& error);

  std::vector<std::string> lines_;
};

}  // namespace limn
