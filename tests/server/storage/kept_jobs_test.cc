#include "server/storage/kept_jobs.h"

#include <map>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"

namespace isomatch {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

class KeptJobsTest : public testing::Test {
 protected:
  /// A job that ended after those before; with a result of so many bytes, or
  /// cancelled.
  void End(const std::string& id, const std::string& tenant,
           std::int64_t bytes) {
    JobRecord record;
    record.id = id;
    record.tenant = tenant;
    record.sequence = ++sequence_;
    record.state = bytes == 0 ? JobState::kCancelled : JobState::kSucceeded;
    if (bytes > 0) {
      record.result.emplace();
      record.result->parts.push_back({ResultPart::kMap, id, bytes});
    }
    kept_.Add(record);
    records_[id] = record;
  }

  void EndMany(const std::string& tenant, int count, std::int64_t bytes) {
    for (int i = 1; i <= count; ++i) {
      End(absl::StrCat(tenant, bytes == 0 ? "c" : "r", i), tenant, bytes);
    }
  }

  KeptJobs kept_;
  std::map<std::string, JobRecord> records_;
  std::uint64_t sequence_ = 0;
};

TEST_F(KeptJobsTest, CancelledJobsPushOutNoResults) {
  EndMany("a", 3, 10);
  EndMany("a", 5, 0);
  EXPECT_THAT(kept_.Excess({.max_jobs = 3}), ElementsAre("ac1", "ac2"));
}

TEST_F(KeptJobsTest, WhoHasMostLosesItsOldest) {
  EndMany("b", 1, 10);
  EndMany("a", 6, 10);
  EXPECT_THAT(kept_.Excess({.max_jobs = 4}),
              UnorderedElementsAre("ar1", "ar2", "ar3"));
  // The same of bytes, whoever has more jobs.
  EndMany("c", 1, 1000);
  EndMany("d", 1, 10);
  EXPECT_THAT(kept_.Excess({.max_result_bytes = 1000}), ElementsAre("cr1"));
}

TEST_F(KeptJobsTest, ATenantMayHaveALimitOfItsOwn) {
  EndMany("a", 3, 10);
  EndMany("b", 1, 10);
  EXPECT_THAT(kept_.Excess({.max_jobs_per_tenant = 2}), ElementsAre("ar1"));
}

TEST_F(KeptJobsTest, TheLastToEndStaysUnlessItIsTooOld) {
  EndMany("b", 1, 10);
  EndMany("a", 1, 1000);
  EXPECT_THAT(kept_.Excess({.max_result_bytes = 5}), ElementsAre("br1"));
  EXPECT_THAT(kept_.Excess({.ended_before = absl::InfiniteFuture()}),
              UnorderedElementsAre("ar1", "br1"));
}

TEST_F(KeptJobsTest, WhatIsRemovedCountsNoMore) {
  EndMany("a", 3, 10);
  kept_.Remove(records_["ar1"]);
  EXPECT_THAT(kept_.Excess({.max_jobs = 2, .max_result_bytes = 20}), IsEmpty());
  for (const char* id : {"ar2", "ar3"}) kept_.Remove(records_[id]);
  EXPECT_THAT(kept_.Excess({.ended_before = absl::InfiniteFuture()}),
              IsEmpty());
}

}  // namespace
}  // namespace isomatch
