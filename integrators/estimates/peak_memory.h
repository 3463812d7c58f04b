#pragma once
#include <cstdint>

namespace limn {

// The largest resident size of this process since the last reset, in bytes; 0 where the system does
// not tell (Linux does, see proc(5): clear_refs and VmHWM).
void reset_peak_memory();
uint64_t peak_memory_bytes();

}  // namespace limn
