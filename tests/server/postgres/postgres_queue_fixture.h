#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/time/clock.h"
#include "core/base/sha256.h"
#include "server/postgres/postgres_blob_store.h"
#include "server/postgres/postgres_job_store.h"
#include "tests/server/postgres/test_database.h"
#include "tests/server/storage/job_store_conformance.h"
#include "tests/support/matchers.h"

namespace isomatch {

class KeptPostgresJobStore : public KeptJobStore {
 public:
  explicit KeptPostgresJobStore(std::unique_ptr<PostgresPool> pool)
      : pool_(std::move(pool)),
        store_(pool_.get(), {.unwatched_grace = absl::Milliseconds(200)}),
        blobs_(pool_.get(), {.capacity_bytes = 1 << 30}) {}

  PostgresJobStore& store() override { return store_; }
  PostgresPool& pool() { return *pool_; }

  std::string Put(const std::string& tenant,
                  const std::string& bytes) override {
    std::string sha256 = Sha256Hex(bytes);
    EXPECT_THAT(blobs_.Put({tenant, sha256}, bytes, Keep::kPinned), IsOk());
    return sha256;
  }

 private:
  const std::unique_ptr<PostgresPool> pool_;
  PostgresJobStore store_;
  PostgresBlobStore blobs_;
};
/// What only a store that several processes share can do.
class PostgresQueueTest : public testing::Test {
 protected:
  void SetUp() override {
    auto pool = NewDatabase();
    ASSERT_THAT(pool, IsOk());
    kept_ = std::make_unique<KeptPostgresJobStore>(*std::move(pool));
  }

  PostgresJobStore& store() { return kept_->store(); }

  JobRecord Insert(JobRecord job) {
    const auto stored = store().Insert(std::move(job));
    EXPECT_THAT(stored, IsOk());
    return *stored;
  }

  static JobRecord Job(const std::string& id, const std::string& tenant = "t",
                       int priority = 0, std::int64_t bytes = 1) {
    JobRecord job;
    job.id = id;
    job.tenant = tenant;
    job.priority = priority;
    job.memory_estimate_bytes = bytes;
    return job;
  }

  static ClaimRequest Asking(std::int64_t free = 100,
                             absl::Duration lease = absl::Seconds(15)) {
    ClaimRequest request;
    request.worker = "w";
    request.free_bytes = free;
    request.total_bytes = 100;
    request.lease = lease;
    request.max_running_per_tenant = 100;
    return request;
  }

  std::string ClaimId(const ClaimRequest& request = Asking()) {
    const auto claimed = store().Claim(request);
    EXPECT_THAT(claimed, IsOk());
    return claimed.ok() && *claimed ? (*claimed)->id : "none";
  }

  /// Claims a job and lets its lease run out.
  JobRecord ClaimAndExpire(const std::string& id) {
    EXPECT_EQ(ClaimId(Asking(100, absl::Milliseconds(1))), id);
    absl::SleepFor(absl::Milliseconds(20));
    const auto expired = store().Expired(absl::ZeroDuration());
    EXPECT_THAT(expired, IsOk());
    EXPECT_THAT(*expired, testing::SizeIs(1));
    return expired->front();
  }

  std::unique_ptr<KeptPostgresJobStore> kept_;
};

}  // namespace isomatch
