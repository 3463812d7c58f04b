#pragma once
// How a check with a limit of time divides it between a gradient and its differences.
#include <cstdint>
#include <optional>

namespace limn {

// Samples per pixel.
struct CheckSamples {
  int64_t gradient = 0, differences = 0;
};

// What a run cost and what its mean's variance was.
struct CheckCost {
  int64_t samples = 0;
  double seconds = 0;
  double variance = 0;
};

// The first run's: enough for variances.
inline constexpr int64_t kFirstCheckSamples = 16;
// At most: a second run takes twice as many, in an int.
inline constexpr int64_t kMostCheckSamples = 1 << 29;

// The samples of least time with which the error of the difference becomes `factor` times as large,
// or the smallest error that takes `seconds` at most. Nothing where that is no longer run. Neither
// takes less than an eighth of the time: a few samples may not hold the events that rule their
// variance.
std::optional<CheckSamples> more_samples(const CheckCost& gradient, const CheckCost& differences,
                                         double factor, double seconds);

}  // namespace limn
