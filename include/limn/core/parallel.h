#pragma once
// Work on several threads. What is computed never depends on how it is spread.
#include <cstddef>
#include <functional>

namespace limn {

// Threads to use when the user asks for `requested`; 0 means all cores.
int thread_count(int requested);

// Calls work(i) for every i in [0, count), on at most `threads` threads. An exception in one stops
// the rest and is thrown here.
void parallel_for(size_t count, int threads, const std::function<void(size_t)>& work);

}  // namespace limn
