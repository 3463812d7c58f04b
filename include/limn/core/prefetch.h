#pragma once
// Reading ahead.

namespace limn {

// Brings the line of an address into the cache; any address will do. GCC takes a function that does
// only this for one without effect, and drops its calls: the empty statement is an effect.
inline void prefetch(const void* address) {
  asm volatile("");
  __builtin_prefetch(address);
}

}  // namespace limn
