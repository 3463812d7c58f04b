#pragma once
// What reads files that may hold anything, as functions of their bytes.
#include <cstdint>
#include <span>
#include <string>

namespace limn {

using Bytes = std::span<const uint8_t>;

// A reader. run() returns if the bytes were read or refused by an InputError; what was read is held
// against what its type promises, and std::abort() tells of a breach. Any other exception is a
// mistake, too, and passes through.
struct FuzzTarget {
  const char* name;
  void (*run)(Bytes bytes);
};

inline constexpr int kFuzzTargets = 12;
extern const FuzzTarget kAllFuzzTargets[kFuzzTargets];

// The target of this name; std::abort() without one.
const FuzzTarget& fuzz_target(const std::string& name);

}  // namespace limn
