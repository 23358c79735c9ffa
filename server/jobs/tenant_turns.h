#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "core/base/mutex.h"
#include "server/machine/executor.h"

namespace isomatch {

/// Runs tasks of tenants in turns: next is the first task of the tenant that
/// was served least recently, of those of which fewer than
/// `max_running_per_tenant` run. With one thread more than that, the tasks of a
/// tenant wait for none of another's, however many and slow they are; else for
/// one.
///
/// Remembers every tenant; there are as many as API keys. Thread-safe. No lock
/// is held while a task runs.
class TenantTurns {
 public:
  struct Limits {
    /// Tasks of one tenant that run at a time, and that wait.
    int max_running_per_tenant = 1;
    int max_waiting_per_tenant = 1;
  };

  /// As many tasks run at a time as `executor` has threads. It outlives this
  /// object, or is joined before.
  TenantTurns(const Limits& limits, Executor* executor)
      : limits_(limits), executor_(executor) {}

  /// Takes a task. RESOURCE_EXHAUSTED (TENANT_QUOTA) when too many of the
  /// tenant wait; ends with std::bad_alloc when there is no memory for it: then
  /// it never runs.
  absl::Status Post(const std::string& tenant, std::function<void()> task);

 private:
  struct Task {
    std::uint64_t number;
    std::function<void()> run;
  };
  struct Tenant {
    std::deque<Task> waiting;
    int running = 0;
    /// Number of its last start among all; 0 for none.
    std::uint64_t last_served = 0;
  };

  /// Removes a task that waits; false when it does not any more. For one that
  /// no Run was posted for.
  bool Remove(const std::string& tenant, std::uint64_t number);
  /// Runs tasks until none may run.
  void Run();
  /// False, and the Run is over, when none may.
  bool RunOne();
  /// Returns whose turn it is; null when no task may run.
  Tenant* NextTenant() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Limits limits_;
  Executor* const executor_;
  Mutex mutex_;
  std::map<std::string, Tenant> tenants_ ABSL_GUARDED_BY(mutex_);
  std::uint64_t last_served_ ABSL_GUARDED_BY(mutex_) = 0;
  std::uint64_t last_number_ ABSL_GUARDED_BY(mutex_) = 0;
  /// Runs that the executor has, or is about to get.
  int runs_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace isomatch
