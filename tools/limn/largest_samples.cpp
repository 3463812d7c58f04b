// Single samples that dominate a term's error.
#include "tools/limn/largest_samples.h"

namespace limn {

// From this share of the sum of squares of a term's samples on, one is an outlier. Not tuned.
constexpr double kRulingShare = 0.1;

void print_largest(const std::vector<TermRun>& terms, int64_t spp, const std::string& command_line,
                   bool all) {
  for (const TermRun& term : terms) {
    const LargestSample& largest = term.cost.largest;
    if (!term.computed || largest.square == 0) continue;
    if (!all && largest.share() < kRulingShare) continue;
    NonFinite::SampleId place = largest.place;
    if (place.x < 0) place.term = term.name;
    fmt::print("{}: one sample is {:.0f} % of the sum of squares (an outlier): {}\n", term.name,
               100 * largest.share(),
               place.x >= 0
                   ? fmt::format("pixel ({}, {}), sample {}", place.x, place.y, place.sample)
                   : fmt::format("sample {} of {} samples per pixel", place.sample, spp));
    if (!command_line.empty()) fmt::print("  trace: {}\n", repeat_command(command_line, place));
  }
}

}  // namespace limn
