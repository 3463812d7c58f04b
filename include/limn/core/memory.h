#pragma once
// Memory that is free, and that was taken.
#include <cstdint>
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

// The largest resident size of this process since the last reset, in bytes; 0 where the system does
// not tell (Linux does, see proc(5): clear_refs and VmHWM).
void reset_peak_memory();
uint64_t peak_memory_bytes();

}  // namespace limn
