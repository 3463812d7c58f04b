#pragma once
// Memory checks before large allocations.
#include <string>

#include "limn/core/error.h"

namespace limn {

// Bytes that this process can still allocate: the machine's free memory, or less under a
// container's limit or `ulimit -v`. Infinity if the system does not report it.
double free_memory();

// InputError at `where` if `bytes` (64 MB or more) exceed free_memory(): "WHAT takes 12.3 GB of
// memory, and 4.5 GB are free: REMEDY".
void require_memory(const SourceLocation& where, double bytes, const std::string& what,
                    const std::string& remedy);

}  // namespace limn
