#include "server/jobs/tenant_budgets.h"

namespace isomatch {

MemoryBudget& TenantBudgets::Of(const std::string& tenant) {
  MutexLock lock(mutex_);
  return of_tenants_.try_emplace(tenant, share_bytes_, whole_).first->second;
}

}  // namespace isomatch
