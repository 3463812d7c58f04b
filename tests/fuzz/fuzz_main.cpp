// libFuzzer's entry into one target, whose name the build sets.
#include "fuzz/fuzz_targets.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const limn::FuzzTarget& target = limn::fuzz_target(LIMN_FUZZ_TARGET);
  target.run({data, size});
  return 0;
}
