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

}  // namespace limn
