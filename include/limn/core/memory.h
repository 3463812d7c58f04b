#pragma once
// Memory that is asked for before it is taken.
#include <string>

#include "limn/core/error.h"

namespace limn {

// Bytes that this process may still take: what the machine has free, or less where a container or
// `ulimit -v` allows less. Infinity where the system does not tell.
double free_memory();

// InputError at `where` if `bytes` (64 MB or more) exceed free_memory(): "WHAT takes 12.3 GB of
// memory, and 4.5 GB are free: REMEDY".
void require_memory(const SourceLocation& where, double bytes, const std::string& what,
                    const std::string& remedy);

}  // namespace limn
