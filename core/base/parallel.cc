#include "core/base/parallel.h"

#include <algorithm>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

namespace isomatch {

absl::Status ParallelFor(std::int64_t count, const std::stop_token& stop,
                         const std::function<void(std::int64_t)>& body) {
  tbb::parallel_for(tbb::blocked_range<std::int64_t>(0, count, 1),
                    [&](const tbb::blocked_range<std::int64_t>& range) {
                      for (std::int64_t i = range.begin(); i != range.end();
                           ++i) {
                        if (stop.stop_requested()) return;
                        body(i);
                      }
                    });
  return CheckNotCancelled(stop);
}

absl::Status ParallelForVertices(VertexIndex count, const std::stop_token& stop,
                                 const std::function<void(VertexIndex)>& body) {
  constexpr std::int64_t kVerticesPerTask = 256;
  const std::int64_t tasks = (count + kVerticesPerTask - 1) / kVerticesPerTask;
  return ParallelFor(tasks, stop, [&](std::int64_t task) {
    const std::int64_t begin = task * kVerticesPerTask;
    const std::int64_t end =
        std::min<std::int64_t>(count, begin + kVerticesPerTask);
    for (std::int64_t v = begin; v < end; ++v) {
      body(static_cast<VertexIndex>(v));
    }
  });
}

absl::Status RunBoth(const std::function<absl::Status()>& first,
                     const std::function<absl::Status()>& second) {
  absl::Status status_first;
  absl::Status status_second;
  tbb::parallel_invoke([&] { status_first = first(); },
                       [&] { status_second = second(); });
  return status_first.ok() ? status_second : status_first;
}

absl::Status CheckNotCancelled(const std::stop_token& stop) {
  if (stop.stop_requested()) return absl::CancelledError("cancelled");
  return absl::OkStatus();
}

void RunWithThreads(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  arena.execute([&] { body(); });
}

}  // namespace isomatch
