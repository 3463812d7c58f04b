// The corpus of tools/fuzz through the same functions, without a fuzzer.
#include <gtest/gtest.h>

#include <filesystem>

#include "fuzz/fuzz_targets.h"
#include "src/base/text.h"

namespace limn {
namespace {

const std::filesystem::path kCorpus =
    std::filesystem::path(LIMN_SOURCE_DIR) / "tests" / "fuzz" / "corpus";

Bytes bytes_of(const std::string& text) {
  return {reinterpret_cast<const uint8_t*>(text.data()), text.size()};
}

class FuzzCorpus : public testing::TestWithParam<FuzzTarget> {};

TEST_P(FuzzCorpus, IsReadOrRefused) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kCorpus / GetParam().name)) {
    SCOPED_TRACE(entry.path());
    const std::string content = read_whole_file(entry.path().string());
    EXPECT_NO_THROW(GetParam().run(bytes_of(content)));
    ++files;
  }
  EXPECT_GT(files, 2);
}

// Some neighbours of each file: cut short, and with one byte replaced.
TEST_P(FuzzCorpus, NeighboursAreReadOrRefused) {
  for (const auto& entry : std::filesystem::directory_iterator(kCorpus / GetParam().name)) {
    SCOPED_TRACE(entry.path());
    const std::string content = read_whole_file(entry.path().string());
    const size_t step = 1 + content.size() / 25;
    for (size_t i = 0; i < content.size(); i += step) {
      EXPECT_NO_THROW(GetParam().run(bytes_of(content.substr(0, i)))) << i;
      for (const int byte : {0, 1, 0x2d, 0x39, 0x7f, 0xff}) {
        std::string other = content;
        other[i] = static_cast<char>(byte);
        EXPECT_NO_THROW(GetParam().run(bytes_of(other))) << i << " " << byte;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, FuzzCorpus, testing::ValuesIn(kAllFuzzTargets),
                         [](const auto& c) { return c.param.name; });

}  // namespace
}  // namespace limn
