// Parsing of numbers and words, and reading of whole files.
#include "src/base/text.h"

#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "limn/core/memory.h"

namespace limn {

namespace {

constexpr std::string_view kLfsPointer = "version https://git-lfs.github.com/spec/";

// Removes a leading plus sign, which from_chars does not accept.
std::string_view without_plus(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  return text;
}

}  // namespace

std::optional<double> parse_double(std::string_view text) {
  text = without_plus(text);
  double number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (end != text.data() + text.size()) return std::nullopt;
  if (error == std::errc::result_out_of_range) {
    // Both overflow ("1e400") and underflow ("1e-400") get here; only underflow is valid.
    if (text.find("e-") == text.npos && text.find("E-") == text.npos) return std::nullopt;
    return 0.0;
  }
  if (error != std::errc()) return std::nullopt;
  return number;
}

std::optional<int64_t> parse_integer(std::string_view text) {
  text = without_plus(text);
  int64_t number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return number;
}

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> pieces;
  size_t begin = text.find_first_not_of(separators);
  while (begin != text.npos) {
    const size_t end = std::min(text.find_first_of(separators, begin), text.size());
    pieces.push_back(text.substr(begin, end - begin));
    begin = text.find_first_not_of(separators, end);
  }
  return pieces;
}

std::string read_whole_file(const std::string& file) {
  const auto fail = [&](const std::string& why) {
    throw InputError({file}, "cannot read: " + why);
  };
  std::error_code error;
  const uintmax_t size = std::filesystem::file_size(file, error);
  if (error) fail(error.message());
  if (!std::filesystem::is_regular_file(file)) fail("it is not a regular file");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) fail(std::strerror(errno));
  require_memory({file}, static_cast<double>(size), "the file", "split it");
  std::string content(size, '\0');
  stream.read(content.data(), static_cast<std::streamsize>(size));
  if (static_cast<uintmax_t>(stream.gcount()) != size) fail("it ended while it was read");
  if (content.starts_with(kLfsPointer)) {
    throw InputError({file}, "is a pointer of Git LFS in place of the file (git lfs pull gets it)");
  }
  return content;
}

}  // namespace limn
