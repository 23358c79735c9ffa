#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include "core/base/parallel.h"

namespace isomatch {

absl::Status ParallelFor(std::int64_t count, const std::stop_token& stop,
                         const std::function<void(std::int64_t)>& body) {
  using Range = tbb::blocked_range<std::int64_t>;
  tbb::parallel_for(Range(0, count, 1), [&](const Range& range) {
    for (std::int64_t i = range.begin(); i != range.end(); ++i) {
      if (stop.stop_requested()) return;
      body(i);
    }
  });
  return CheckNotCancelled(stop);
}

absl::Status RunBoth(const std::function<absl::Status()>& first,
                     const std::function<absl::Status()>& second) {
  absl::Status status_first;
  absl::Status status_second;
  tbb::parallel_invoke([&] { status_first = first(); },
                       [&] { status_second = second(); });
  return status_first.ok() ? status_second : status_first;
}

void RunWithThreads(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute(body);
}

}  // namespace isomatch
