#pragma once
// What the terms of a run cost, and single samples that dominate their errors.
#include "tools/limn/command_support.h"

namespace limn {

nlohmann::json costs_json(const std::vector<TermRun>& terms);
nlohmann::json stats_json(const GradientStats& stats);
// For --stats.
void print_stats(const GradientStats& stats, const std::vector<TermRun>& terms);

// Samples that are outliers, or the largest of every term, each with the command that traces it.
// command_line: of the run; "" where no command repeats its samples.
void print_largest(const std::vector<TermRun>& terms, int64_t spp, const std::string& command_line,
                   bool all);

}  // namespace limn
