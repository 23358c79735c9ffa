#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>

#include "absl/status/status.h"
#include "core/base/vertex_index.h"

namespace isomatch {

/// Calls `body(i)` for i in [0, count), in any order, on the threads of the
/// calling oneTBB arena. Indices not started yet are skipped once `stop` is
/// requested, and the call then returns CANCELLED.
///
/// Deterministic at any thread count as long as body(i) writes only what
/// belongs to i.
absl::Status ParallelFor(std::int64_t count, const std::stop_token& stop,
                         const std::function<void(std::int64_t)>& body);

/// The same for vertices, some hundred to a task, for bodies that are quick.
absl::Status ParallelForVertices(VertexIndex count, const std::stop_token& stop,
                                 const std::function<void(VertexIndex)>& body);

/// Runs both functions, at the same time where threads allow, and returns the
/// first error in argument order.
absl::Status RunBoth(const std::function<absl::Status()>& first,
                     const std::function<absl::Status()>& second);

/// OK, or CANCELLED once `stop` is requested.
absl::Status CheckNotCancelled(const std::stop_token& stop);

/// Runs `body` in an arena of its own of at most `threads` threads, 0 meaning
/// one for each core.
void RunWithThreads(int threads, const std::function<void()>& body);

}  // namespace isomatch
