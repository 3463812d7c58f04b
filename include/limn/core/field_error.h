#pragma once
// Errors of options. The library names the field; the program adds its command line's spelling.
#include <string>

#include "limn/core/error.h"

namespace limn {

// what() is "error: FIELD: MESSAGE".
class FieldError : public InputError {
 public:
  FieldError(const std::string& field_name, const std::string& text)
      : InputError(field_name + ": " + text), field(field_name), message(text) {}
  std::string field, message;
};

// FieldError unless least <= value <= most; not a number is outside.
void check_range(const std::string& field, double value, double least, double most);

}  // namespace limn
