#include "limn/core/error.h"

namespace limn {

std::string format_error(const SourceLocation& where, const std::string& message) {
  std::string text;
  if (!where.file.empty()) {
    text = where.file + ":";
    if (where.line > 0) {
      text += std::to_string(where.line) + ":";
      if (where.column > 0) text += std::to_string(where.column) + ":";
    }
    text += " ";
  }
  return text + "error: " + message;
}

InputError::InputError(const SourceLocation& where, const std::string& message)
    : std::runtime_error(format_error(where, message)) {}

InputError::InputError(const std::string& message) : InputError(SourceLocation{}, message) {}

}  // namespace limn
