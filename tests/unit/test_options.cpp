// The table of options: what its rows say, and what they refuse.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "limn/core/error.h"
#include "limn/integrators/fit_options.h"
#include "limn/integrators/options.h"

namespace limn {
namespace {

template <class Options>
void expect_sound_rows() {
  std::set<std::string> names;
  Options options;
  visit_options(options, [&](auto& field, const Option& option) {
    EXPECT_TRUE(names.insert(option.name).second) << option.name;
    const std::string help = option.help;
    EXPECT_GT(help.size(), 5u) << option.name;
    EXPECT_NE(help.back(), '.') << option.name;
    EXPECT_TRUE(std::isupper(help.front())) << help;
    EXPECT_LE(option.least, option.most) << option.name;
    EXPECT_NO_THROW(CheckRange()(field, option)) << option.name;  // the default
    if constexpr (Choice<std::remove_reference_t<decltype(field)>>) {
      ASSERT_FALSE(option.words.empty()) << option.name;
      for (const std::string word : option.words) {
        set_word(field, option, word);
        EXPECT_EQ(word_of(field, option), word) << option.name;
      }
    }
  });
  EXPECT_FALSE(names.empty());
}

TEST(Options, RowsAreSound) {
  expect_sound_rows<RunRequest>();
  expect_sound_rows<WarpOptions>();
  expect_sound_rows<RenderOptions>();
  expect_sound_rows<GradientOptions>();
  expect_sound_rows<CheckOptions>();
  expect_sound_rows<BackwardOptions>();
  expect_sound_rows<LossOptions>();
  expect_sound_rows<FitOptions>();
}

// Every number of every struct is checked, and named.
TEST(Options, NumbersOutOfRangeAreRefused) {
  size_t refused = 0;
  const auto refuses = [&]<class Options>(Options options) {
    visit_options(options, [&](auto& field, const Option& option) {
      if constexpr (std::is_arithmetic_v<std::remove_reference_t<decltype(field)>>) {
        if (!option.words.empty()) return;
        const auto before = field;
        field = -1;  // below every range
        try {
          check_options(options);
          ADD_FAILURE() << option.name;
        } catch (const FieldError& error) {
          EXPECT_EQ(error.field, option.name);
          EXPECT_NE(error.message.find(" is not a number from " + range_text(option)),
                    std::string::npos)
              << error.message;
        }
        field = before;
        ++refused;
      }
    });
  };
  refuses(RenderOptions());
  refuses(CheckOptions());
  refuses(BackwardOptions());
  refuses(FitOptions());
  EXPECT_GT(refused, 20u);
  FitOptions options;
  options.remesh = {3, 0};
  EXPECT_THROW(check_options(options), FieldError);
  options = {};
  options.smoothing = std::nan("");
  EXPECT_THROW(check_options(options), FieldError);
  options.smoothing = 0;
  options.loss_spp = 0;  // which stands for another number
  EXPECT_NO_THROW(check_options(options));
}

TEST(Options, UnknownWordsListTheKnown) {
  try {
    number_of(kPointsOption, "face");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "error: unknown points \"face\" (known: random, faces)");
  }
}

}  // namespace
}  // namespace limn
