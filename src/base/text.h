#pragma once
// Numbers from text, independent of the locale.
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace limn {

// The number that makes up all of `text` (an optional sign, decimal, exponent, "inf" or "nan");
// nothing if `text` is anything else, or too large for a double. Numbers too small become 0.
std::optional<double> parse_double(std::string_view text);
std::optional<int64_t> parse_integer(std::string_view text);

// Pieces of `text` between any of `separators`, without empty pieces.
std::vector<std::string_view> split(std::string_view text, std::string_view separators);

// The whole file; nothing if it cannot be read. InputError where memory does not hold it.
std::optional<std::string> read_whole_file(const std::string& file);

}  // namespace limn
