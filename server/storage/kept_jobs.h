#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "server/storage/job_record.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// The terminal jobs of a store, and which of them have to go. Jobs with a
/// result and those without are counted apart, so that cancelled or failed ones
/// never push out results.
///
/// Not thread-safe.
class KeptJobs {
 public:
  /// REQUIRES: the record is terminal, its sequence new.
  void Add(const JobRecord& record);

  /// REQUIRES: Add was called with this sequence, tenant and state.
  void Remove(const JobRecord& record);

  /// Returns the ids of all that ended too long ago, wherever they stand (a
  /// clock that is set back mixes up times), and of as many others as it takes
  /// to keep the other limits: the oldest of the tenant that has more than its
  /// limit, then the oldest of the tenant that has most, so that nobody loses a
  /// job to a tenant that keeps more. Never the one that ended last but by its
  /// age, however large its result.
  std::vector<std::string> Excess(const KeepLimits& limits) const;

 private:
  struct Job {
    std::string id;
    absl::Time aged_from;
    absl::Duration end_steady;
    std::int64_t result_bytes;
  };
  /// Sequence of the terminal change -> job.
  using Jobs = std::map<std::uint64_t, Job>;
  struct Group {
    Jobs jobs;
    std::int64_t result_bytes = 0;
  };
  /// Whether there is a result, and the tenant.
  using Key = std::pair<bool, std::string>;

  /// What is left of the groups of one kind while jobs are taken out.
  class Selection;

  std::map<Key, Group> groups_;
};

}  // namespace isomatch
