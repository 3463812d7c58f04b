// Parallel loops over oneTBB; the only file that includes it.
#include "limn/core/parallel.h"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/info.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>

#include "limn/core/check.h"

namespace limn {
namespace {

// More threads than cores are allowed: results do not depend on their number, and tests request
// seven. One limit for the whole process, set before TBB or Embree starts its workers: TBB
// warns of every arena that asks for more than the limit of the moment. No higher than that: on a
// machine that is busy TBB starts another worker for each loop whose workers are not back yet
// (counted on two cores under load: 430 of 1024, a third of them running).
const int most_threads = std::max(16, oneapi::tbb::info::default_concurrency());
const oneapi::tbb::global_control limit(oneapi::tbb::global_control::max_allowed_parallelism,
                                        static_cast<size_t>(most_threads));

}  // namespace

int thread_count(int requested) {
  return std::min(requested > 0 ? requested : oneapi::tbb::info::default_concurrency(),
                  most_threads);
}

void parallel_for(size_t count, int threads, const std::function<void(size_t)>& work) {
  CHECK_LE(1, threads);
  oneapi::tbb::task_arena arena(std::min(threads, most_threads));
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
