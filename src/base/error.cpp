// Formatting of errors and warnings.
#include "limn/core/error.h"

namespace limn {

namespace {

// Makes quoted input safe to print: control characters become \x1b, and the middle of an overlong
// message is omitted.
std::string printable(const std::string& message) {
  constexpr size_t kBegin = 1500, kEnd = 300;  // not tuned
  static const char* const kDigits = "0123456789abcdef";
  std::string text;
  for (size_t i = 0; i < message.size(); ++i) {
    const auto c = static_cast<unsigned char>(message[i]);
    if (i == kBegin && message.size() > kBegin + kEnd) {
      text += " [...] ";
      i = message.size() - kEnd;
    } else if (c < 0x20 || c == 0x7f) {
      text += std::string("\\x") + kDigits[c >> 4] + kDigits[c & 15];
    } else {
      text += message[i];
    }
  }
  return text;
}

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
  return text + kind + ": " + printable(message);
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
