#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "absl/status/statusor.h"
#include "server/storage/job_store.h"

namespace isomatch {

/// Returns a job of no tenant.
inline JobRecord NewJob(const std::string& id,
                        const std::string& request_id = "") {
  JobRecord record;
  record.id = id;
  record.request_id = request_id;
  return record;
}

/// Returns the jobs' ids, in their order.
inline std::vector<std::string> IdsOf(const std::vector<JobRecord>& records) {
  std::vector<std::string> ids;
  ids.reserve(records.size());
  for (const JobRecord& record : records) ids.push_back(record.id);
  return ids;
}

/// A job store under test, with what it stands on.
class KeptJobStore {
 public:
  virtual ~KeptJobStore() = default;

  virtual JobStore& store() = 0;

  /// Returns the SHA-256 of a blob that jobs may name, which is there now.
  virtual std::string Put(const std::string& tenant,
                          const std::string& bytes) = 0;
};

/// How to open an empty one.
struct JobStoreKind {
  std::string name;
  std::function<absl::StatusOr<std::unique_ptr<KeptJobStore>>()> open;
};

/// What every JobStore has to do. Whoever has one instantiates it:
///
///   INSTANTIATE_TEST_SUITE_P(Memory, JobStoreTest, testing::Values(kind));
class JobStoreTest : public testing::TestWithParam<JobStoreKind> {
 protected:
  void SetUp() override;

  /// Makes the job SUCCEEDED with a result of `bytes`.
  void Succeed(const std::string& id, int bytes);

  std::unique_ptr<KeptJobStore> kept_;
};

}  // namespace isomatch
