#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/storage/job_record.h"

namespace isomatch {

/// Where the records of jobs outlive the process. Called by one thread at a
/// time, but for Settle.
class JobJournal {
 public:
  virtual ~JobJournal() = default;

  /// Keeps the records, in place of those that have their ids, all or none; on
  /// disk when it returns. RESOURCE_EXHAUSTED: the disk is full; UNAVAILABLE:
  /// it refuses for another reason.
  virtual absl::Status Write(const std::vector<JobRecord>& records) = 0;

  /// Forgets the records with these ids. Errors as Write.
  virtual absl::Status Remove(const std::vector<std::string>& ids) = 0;

  /// Moves what was written to where it lasts, as far as that goes now; beside
  /// Write and Remove, in a thread of its own.
  virtual void Settle() {}
};

}  // namespace isomatch
