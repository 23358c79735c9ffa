#include "server/jobs/tenant_turns.h"

#include <algorithm>
#include <new>
#include <utility>

#include "absl/time/time.h"
#include "server/jobs/errors.h"

namespace isomatch {
namespace {

constexpr absl::Duration kRetryRequests = absl::Seconds(2);

/// More than executors have threads, so that a task waits for no other one's.
constexpr int kMostRuns = 64;

}  // namespace

absl::Status TenantTurns::Post(const std::string& tenant,
                               std::function<void()> task) {
  std::uint64_t number = 0;
  {
    MutexLock lock(mutex_);
    Tenant& own = tenants_[tenant];
    const auto waiting = static_cast<int>(own.waiting.size());
    if (waiting >= limits_.max_waiting_per_tenant) {
      return TenantRequestsQuota(tenant, waiting, kRetryRequests);
    }
    number = ++last_number_;
    own.waiting.push_back({number, std::move(task)});
    // Those that are under way look for it, too.
    if (runs_ == kMostRuns) return absl::OkStatus();
    ++runs_;
  }
  // One that finds nothing to run leaves it to the one that runs the tenant's.
  try {
    executor_->Post([this] { Run(); });
  } catch (const std::bad_alloc&) {
    if (Remove(tenant, number)) throw;  // else another has taken it
  }
  return absl::OkStatus();
}

bool TenantTurns::Remove(const std::string& tenant, std::uint64_t number) {
  std::function<void()> removed;  // freed after the lock
  MutexLock lock(mutex_);
  --runs_;
  std::deque<Task>& waiting = tenants_.find(tenant)->second.waiting;
  const auto found =
      std::find_if(waiting.begin(), waiting.end(),
                   [&](const Task& task) { return task.number == number; });
  if (found == waiting.end()) return false;
  removed = std::move(found->run);
  waiting.erase(found);
  return true;
}

void TenantTurns::Run() {
  while (RunOne()) {
  }
}

bool TenantTurns::RunOne() {
  std::function<void()> task;
  Tenant* tenant = nullptr;
  {
    MutexLock lock(mutex_);
    tenant = NextTenant();
    if (tenant == nullptr) {
      --runs_;
      return false;
    }
    task = std::move(tenant->waiting.front().run);
    tenant->waiting.pop_front();
    tenant->last_served = ++last_served_;
    ++tenant->running;
  }
  try {
    task();
  } catch (const std::bad_alloc&) {  // as of an executor's task
  }
  task = nullptr;  // what it holds goes before others run
  MutexLock lock(mutex_);
  --tenant->running;
  return true;
}

TenantTurns::Tenant* TenantTurns::NextTenant() {
  Tenant* next = nullptr;
  for (auto& [name, tenant] : tenants_) {
    const bool may_run = !tenant.waiting.empty() &&
                         tenant.running < limits_.max_running_per_tenant;
    if (!may_run) continue;
    if (next == nullptr || tenant.last_served < next->last_served) {
      next = &tenant;
    }
  }
  return next;
}

}  // namespace isomatch
