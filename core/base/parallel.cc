#include "core/base/parallel.h"

#include <algorithm>

namespace isomatch {

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

absl::Status CheckNotCancelled(const std::stop_token& stop) {
  if (stop.stop_requested()) return absl::CancelledError("cancelled");
  return absl::OkStatus();
}

}  // namespace isomatch
