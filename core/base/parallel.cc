#include "core/base/parallel.h"

#include <algorithm>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#if defined(__SANITIZE_THREAD__)
#include <sanitizer/tsan_interface.h>
#endif

namespace isomatch {
namespace {

/// Tells ThreadSanitizer what Debian's oneTBB, which is not built for it, does
/// not: tasks begin after the fork and end before the join. Nothing otherwise.
class ForkAndJoin {
 public:
  ForkAndJoin() { Release(&fork_); }
  ~ForkAndJoin() { Acquire(&join_); }

  template <typename Body>
  void RunTask(const Body& body) {
    Acquire(&fork_);
    body();
    Release(&join_);
  }

 private:
#if defined(__SANITIZE_THREAD__)
  static void Acquire(char* at) { __tsan_acquire(at); }
  static void Release(char* at) { __tsan_release(at); }
#else
  static void Acquire(char*) {}
  static void Release(char*) {}
#endif

  char fork_ = 0;
  char join_ = 0;
};

}  // namespace

absl::Status ParallelFor(std::int64_t count, const std::stop_token& stop,
                         const std::function<void(std::int64_t)>& body) {
  using Range = tbb::blocked_range<std::int64_t>;
  {
    ForkAndJoin tasks;
    tbb::parallel_for(Range(0, count, 1), [&](const Range& range) {
      tasks.RunTask([&] {
        for (std::int64_t i = range.begin(); i != range.end(); ++i) {
          if (stop.stop_requested()) return;
          body(i);
        }
      });
    });
  }
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
  {
    ForkAndJoin tasks;
    tbb::parallel_invoke(
        [&] { tasks.RunTask([&] { status_first = first(); }); },
        [&] { tasks.RunTask([&] { status_second = second(); }); });
  }
  return status_first.ok() ? status_second : status_first;
}

absl::Status CheckNotCancelled(const std::stop_token& stop) {
  if (stop.stop_requested()) return absl::CancelledError("cancelled");
  return absl::OkStatus();
}

void RunWithThreads(int threads, const std::function<void()>& body) {
  tbb::task_arena arena(threads > 0 ? threads : tbb::task_arena::automatic);
  ForkAndJoin task;
  arena.execute([&] { task.RunTask(body); });
}

}  // namespace isomatch
