#pragma once
// Names of test cases, which may hold letters, digits and underscores only.
#include <gtest/gtest.h>

#include <cctype>
#include <string>

namespace limn {

inline std::string test_name(std::string text) {
  for (char& c : text) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return text;
}

// For INSTANTIATE_TEST_SUITE_P over strings.
inline std::string name_of_string(const testing::TestParamInfo<std::string>& test) {
  return test_name(test.param);
}

}  // namespace limn
