#pragma once

#include <functional>
#include <memory>

#include "absl/time/time.h"

namespace isomatch {

/// Runs functions on threads of its own. A function that throws std::bad_alloc
/// does not end the process: one that was posted is dropped, one of a timer is
/// soon run again. Thread-safe.
class Executor {
 public:
  /// Dropping it calls the timer off, unless its function has begun.
  using Timer = std::shared_ptr<void>;

  virtual ~Executor() = default;

  /// Runs `task` soon, in the order of the calls where there is one thread.
  virtual void Post(std::function<void()> task) = 0;

  /// Starts one more thread, in place of one that does not come back; false
  /// when there cannot be one.
  virtual bool AddThread() { return false; }

  /// Runs `task` once `delay` has passed.
  [[nodiscard]] virtual Timer PostAfter(absl::Duration delay,
                                        std::function<void()> task) = 0;
};

}  // namespace isomatch
