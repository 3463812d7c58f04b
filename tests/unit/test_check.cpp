// What a failed check prints, and when it looks.
#include "limn/core/check.h"

#include <gtest/gtest.h>

namespace limn {
namespace {

TEST(CheckDeathTest, PrintsConditionOperandsAndPlace) {
  const int lane = 7, count = 4;
  EXPECT_DEATH(CHECK_LT(lane, count),
               "test_check.cpp:[0-9]+: check failed: lane < count .7 and 4.");
  EXPECT_DEATH(CHECK_LE(0.1 + 0.2, 0.3), "0.30000000000000004 and 0.29999999999999999");
  EXPECT_DEATH(CHECK_EQ(std::string("a"), "b"), "== \"b\" .a and b.");
  EXPECT_DEATH(CHECK(lane < 3), "check failed: lane < 3");
}

TEST(Check, EvaluatesEachOperandOnce) {
  int evaluated = 0;
  CHECK_EQ(++evaluated, 1);
  CHECK(++evaluated == 2);
  EXPECT_EQ(evaluated, 2);
}

TEST(CheckDeathTest, DebugChecksLookInDebugBuildsAlone) {
  int evaluated = 0;
  DCHECK_EQ(++evaluated, 1);
  DCHECK(++evaluated == 2);
#ifdef NDEBUG
  EXPECT_EQ(evaluated, 0);
  DCHECK_LT(1, 0);
#else
  EXPECT_EQ(evaluated, 2);
  EXPECT_DEATH(DCHECK_LT(1, 0), "1 < 0");
#endif
}

}  // namespace
}  // namespace limn
