#pragma once
// Parallel loops. Results never depend on the number of threads or on scheduling.
#include <cstddef>
#include <functional>

namespace limn {

// Number of threads for a user's request; 0 means all cores.
int thread_count(int requested);

// Calls work(i) for every i in [0, count) on at most `threads` threads. The first exception stops
// the remaining work and is rethrown.
void parallel_for(size_t count, int threads, const std::function<void(size_t)>& work);

}  // namespace limn
