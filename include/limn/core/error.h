#pragma once
// Errors that a user can correct: each says what is wrong, where, and how to fix it.
#include <stdexcept>
#include <string>

namespace limn {

// A location in an input file. Line and column count from 1; 0 means unknown.
struct SourceLocation {
  std::string file;
  int line = 0;
  int column = 0;
};

// "file:line:col: error: message", without those parts of the location that are unknown.
std::string format_error(const SourceLocation& where, const std::string& message);
// "file:line:col: warning: message", likewise.
std::string format_warning(const SourceLocation& where, const std::string& message);

// Invalid input. what() is the complete line for the user.
class InputError : public std::runtime_error {
 public:
  InputError(const SourceLocation& where, const std::string& message);
  explicit InputError(const std::string& message);
};

// The scene has no parameter of this name. what() lists the nearest names.
class UnknownParameter : public InputError {
 public:
  using InputError::InputError;
};

// Of an option: the library names the field, the program its spelling. "error: FIELD: MESSAGE".
class FieldError : public InputError {
 public:
  FieldError(const std::string& field_name, const std::string& text)
      : InputError(field_name + ": " + text), field(field_name), message(text) {}
  std::string field, message;
};

}  // namespace limn
