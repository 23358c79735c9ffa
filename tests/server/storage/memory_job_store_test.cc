#include "server/storage/memory_job_store.h"

#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;

JobRecord NewJob(const std::string& id, const std::string& request_id = "") {
  JobRecord record;
  record.id = id;
  record.request_id = request_id;
  return record;
}

/// Makes the job SUCCEEDED with a result of `bytes`.
void Succeed(MemoryJobStore& store, const std::string& id, int bytes) {
  JobRecord record = *store.Get(id);
  record.state = JobState::kSucceeded;
  // In two parts.
  record.result.emplace().parts = {{ResultPart::kMap, "", 1},
                                   {ResultPart::kConfidence, "", bytes - 1}};
  ASSERT_THAT(store.Update(record), IsOk());
}

std::vector<std::string> Ids(const std::vector<JobRecord>& records) {
  std::vector<std::string> ids;
  for (const JobRecord& record : records) ids.push_back(record.id);
  return ids;
}

TEST(MemoryJobStoreTest, SequencesGrowWithEveryChangeOfAnyJob) {
  MemoryJobStore store;
  const JobRecord a = *store.Insert(NewJob("a"));
  const JobRecord b = *store.Insert(NewJob("b"));
  const JobRecord a2 = *store.Update(a);
  EXPECT_LT(a.sequence, b.sequence);
  EXPECT_LT(b.sequence, a2.sequence);
  EXPECT_EQ(a.number, a2.number);
}

TEST(MemoryJobStoreTest, AnUpdateOfAnOldSequenceIsAborted) {
  MemoryJobStore store;
  const JobRecord old = *store.Insert(NewJob("a"));
  ASSERT_THAT(store.Update(old), IsOk());
  EXPECT_THAT(store.Update(old), StatusIs(absl::StatusCode::kAborted, _));
  EXPECT_THAT(store.Update(NewJob("b")),
              StatusIs(absl::StatusCode::kNotFound, _));
}

TEST(MemoryJobStoreTest, IdsAndRequestIdsAreUnique) {
  MemoryJobStore store;
  ASSERT_THAT(store.Insert(NewJob("a", "r")), IsOk());
  EXPECT_THAT(store.Insert(NewJob("a")),
              StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(store.Insert(NewJob("b", "r")),
              StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(store.Insert(NewJob("c")), IsOk());
  EXPECT_THAT(store.Insert(NewJob("d")), IsOk());  // no request_id, twice
  EXPECT_EQ(store.FindByRequestId("r")->id, "a");
}

TEST(MemoryJobStoreTest, ListsNewestFirstByStateAndInPages) {
  MemoryJobStore store;
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed(store, "b", 0);
  EXPECT_THAT(Ids(store.List({})), ElementsAre("d", "c", "b", "a"));
  EXPECT_THAT(Ids(store.List({{JobState::kSucceeded}, 0, 10})),
              ElementsAre("b"));
  const auto page = store.List({{}, 0, 2});
  EXPECT_THAT(Ids(page), ElementsAre("d", "c"));
  EXPECT_THAT(Ids(store.List({{}, page.back().number, 2})),
              ElementsAre("b", "a"));
}

TEST(MemoryJobStoreTest, OnlyTerminalJobsAreDeleted) {
  MemoryJobStore store;
  ASSERT_THAT(store.Insert(NewJob("a", "r")), IsOk());
  EXPECT_THAT(store.Delete("a"),
              StatusIs(absl::StatusCode::kFailedPrecondition, _));
  Succeed(store, "a", 1);
  EXPECT_THAT(store.Delete("a"), IsOk());
  EXPECT_THAT(store.Delete("a"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_FALSE(store.FindByRequestId("r"));
  EXPECT_THAT(store.List({}), IsEmpty());
}

TEST(MemoryJobStoreTest, PruneRemovesTheFirstThatEndedAndNoOthers) {
  MemoryJobStore store;
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed(store, "c", 10);
  Succeed(store, "a", 10);
  Succeed(store, "b", 10);
  EXPECT_THAT(Ids(store.Prune(3, 30)), IsEmpty());
  EXPECT_THAT(Ids(store.Prune(2, 30)), ElementsAre("c"));
  EXPECT_THAT(Ids(store.Prune(2, 10)), ElementsAre("a"));
  EXPECT_THAT(Ids(store.Prune(2, 10)), IsEmpty());
  EXPECT_THAT(Ids(store.List({})), ElementsAre("d", "b"));
}

TEST(MemoryJobStoreTest, TheLastToEndIsKeptHoweverLargeItsResult) {
  MemoryJobStore store;
  for (const char* id : {"a", "b"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
    Succeed(store, id, 1000);
  }
  EXPECT_THAT(Ids(store.Prune(2, 10)), ElementsAre("a"));
  EXPECT_THAT(Ids(store.List({})), ElementsAre("b"));
}

}  // namespace
}  // namespace isomatch
