// The words of errors and warnings.
#include "limn/core/error.h"

namespace limn {

namespace {

std::string format(const SourceLocation& where, const std::string& kind,
                   const std::string& message) {
  std::string text;
  if (!where.file.empty()) {
    text = where.file + ":";
    if (where.line > 0) {
      text += std::to_string(where.line) + ":";
      if (where.column > 0) text += std::to_string(where.column) + ":";
    }
    text += " ";
  }
  return text + kind + ": " + message;
}

}  // namespace

std::string format_error(const SourceLocation& where, const std::string& message) {
  return format(where, "error", message);
}

std::string format_warning(const SourceLocation& where, const std::string& message) {
  return format(where, "warning", message);
}

InputError::InputError(const SourceLocation& where, const std::string& message)
    : std::runtime_error(format_error(where, message)) {}

InputError::InputError(const std::string& message) : InputError(SourceLocation{}, message) {}

}  // namespace limn
