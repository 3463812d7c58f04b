#pragma once
// Errors that a user can act on: what is wrong, where, and what to do.
#include <stdexcept>
#include <string>

namespace limn {

// A place in an input file; line and column count from 1, 0 where unknown.
struct SourceLocation {
  std::string file;
  int line = 0;
  int column = 0;
};

// "file:line:col: error: message"; the parts of the location that are unknown are left out.
std::string format_error(const SourceLocation& where, const std::string& message);
// The same with "warning".
std::string format_warning(const SourceLocation& where, const std::string& message);

// Bad input. what() is the whole line for the user.
class InputError : public std::runtime_error {
 public:
  InputError(const SourceLocation& where, const std::string& message);
  explicit InputError(const std::string& message);
};

// A name that no parameter of the scene has; what() lists the nearest.
class UnknownParameter : public InputError {
 public:
  using InputError::InputError;
};

}  // namespace limn
