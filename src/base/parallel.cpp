// Parallel loops over oneTBB; the only file that includes it.
#include "limn/core/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include "limn/core/check.h"

namespace limn {

int thread_count(int requested) {
  return requested > 0 ? requested : oneapi::tbb::info::default_concurrency();
}

void parallel_for(size_t count, int threads, const std::function<void(size_t)>& work) {
  CHECK_LE(1, threads);
  // More threads than cores are allowed: results do not depend on their number, and tests request
  // seven.
  const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                          threads);
  oneapi::tbb::task_arena arena(threads);
  arena.execute([&] {
    oneapi::tbb::parallel_for(
        oneapi::tbb::blocked_range<size_t>(0, count, 1),
        [&](const oneapi::tbb::blocked_range<size_t>& range) {
          for (size_t i = range.begin(); i != range.end(); ++i) work(i);
        },
        oneapi::tbb::simple_partitioner());
  });
}

}  // namespace limn
