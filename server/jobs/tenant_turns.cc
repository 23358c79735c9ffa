#include "server/jobs/tenant_turns.h"

#include <new>
#include <utility>

namespace isomatch {

bool TenantTurns::Post(const std::string& tenant, std::function<void()> task) {
  {
    MutexLock lock(mutex_);
    Tenant& own = tenants_[tenant];
    const auto waiting = static_cast<int>(own.waiting.size());
    if (waiting >= limits_.max_waiting_per_tenant) return false;
    own.waiting.push_back(std::move(task));
  }
  // One that finds nothing to run leaves it to the one that runs the tenant's.
  executor_->Post([this] { Run(); });
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
    if (tenant == nullptr) return false;
    task = std::move(tenant->waiting.front());
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
