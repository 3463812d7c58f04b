#pragma once
// Locale-independent parsing of numbers, and reading of files.
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace limn {

// Parses all of `text` as a number (optional sign, decimal, exponent, "inf" or "nan"). Nothing for
// other text or on overflow; underflow gives 0.
std::optional<double> parse_double(std::string_view text);
std::optional<int64_t> parse_integer(std::string_view text);

// Splits `text` at any of `separators`; omits empty pieces.
std::vector<std::string_view> split(std::string_view text, std::string_view separators);

// The whole file. InputError that says why where it cannot be read or exceeds memory.
std::string read_whole_file(const std::string& file);

}  // namespace limn
