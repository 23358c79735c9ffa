#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "core/base/mutex.h"
#include "server/jobs/memory_budget.h"

namespace isomatch {

/// A budget of which each tenant may have a share at most. The shares may come
/// to more than the whole. Remembers every tenant; there are as many as API
/// keys. Thread-safe.
class TenantBudgets {
 public:
  /// `whole` outlives this object. REQUIRES: share_bytes >= 0.
  TenantBudgets(MemoryBudget* whole, std::int64_t share_bytes)
      : whole_(whole), share_bytes_(share_bytes) {}

  /// Returns the tenant's, which lives as long as this object.
  MemoryBudget& Of(const std::string& tenant);

  MemoryBudget& whole() { return *whole_; }
  std::int64_t share_bytes() const { return share_bytes_; }

 private:
  MemoryBudget* const whole_;
  const std::int64_t share_bytes_;
  Mutex mutex_;
  std::map<std::string, MemoryBudget> of_tenants_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace isomatch
