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
    record.end_time = end_time_;
    record.end_steady = end_steady_;
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
  absl::Time end_time_ = absl::InfinitePast();
  absl::Duration end_steady_ = -absl::InfiniteDuration();
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

TEST_F(KeptJobsTest, OneThatEndedInTheFutureHoldsUpNoOther) {
  const absl::Time now = absl::UnixEpoch();
  end_time_ = now + absl::Hours(1000);
  End("future", "a", 10);
  end_time_ = now - absl::Hours(2);
  End("old", "a", 10);
  end_time_ = now;
  End("new", "a", 10);
  EXPECT_THAT(kept_.Excess({.ended_before = now - absl::Hours(1)}),
              ElementsAre("old"));
  EXPECT_THAT(
      kept_.Excess({.max_jobs = 1, .ended_before = now - absl::Hours(1)}),
      ElementsAre("old", "future"));
}

TEST_F(KeptJobsTest, AJobIsTooOldByBothClocks) {
  end_time_ = absl::UnixEpoch();
  end_steady_ = absl::Hours(5);
  End("here", "a", 10);
  end_steady_ = -absl::InfiniteDuration();
  End("before", "a", 10);
  EXPECT_THAT(kept_.Excess({.ended_before = absl::InfiniteFuture(),
                            .ended_before_steady = absl::Hours(5)}),
              ElementsAre("before"));
  EXPECT_THAT(kept_.Excess({.ended_before = absl::InfiniteFuture(),
                            .ended_before_steady = absl::Hours(6)}),
              ElementsAre("here", "before"));
}

TEST_F(KeptJobsTest, RoomIsMadeByTheOldestResults) {
  EndMany("a", 3, 10);
  EndMany("b", 2, 0);
  End("last", "c", 10);
  EXPECT_THAT(kept_.Excess({.room_bytes = 11}), ElementsAre("ar1", "ar2"));
  EXPECT_THAT(kept_.Excess({.room_bytes = 1000}),
              ElementsAre("ar1", "ar2", "ar3"));
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
