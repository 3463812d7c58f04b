#pragma once
// Single samples that dominate a term's error.
#include "tools/limn/command_support.h"

namespace limn {

// Those that are outliers, or the largest of every term, each with the command that traces it.
// command_line: of the run; "" where no command repeats its samples.
void print_largest(const std::vector<TermRun>& terms, int64_t spp, const std::string& command_line,
                   bool all);

}  // namespace limn
