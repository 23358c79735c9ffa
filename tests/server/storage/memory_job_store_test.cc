#include "server/storage/memory_job_store.h"

#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/server/storage/fake_journal.h"
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

TEST(MemoryJobStoreTest, NumbersBeginAboveThoseOfEarlierProcesses) {
  JobRecord old = NewJob("old");
  old.number = 7;
  const auto ignore = [](const absl::Status&) {};
  MemoryJobStore store({old}, nullptr, ignore, /*first_number=*/100);
  EXPECT_EQ(store.Insert(NewJob("a"))->number, 100);
  MemoryJobStore behind({old}, nullptr, ignore, /*first_number=*/5);
  EXPECT_EQ(behind.Insert(NewJob("a"))->number, 8);
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
  EXPECT_EQ(store.FindByRequestId("", "r")->id, "a");
}

TEST(MemoryJobStoreTest, ListsNewestFirstByStateAndInPages) {
  MemoryJobStore store;
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed(store, "b", 0);
  EXPECT_THAT(Ids(*store.List({})), ElementsAre("d", "c", "b", "a"));
  EXPECT_THAT(Ids(*store.List({.states = {JobState::kSucceeded}})),
              ElementsAre("b"));
  const auto page = *store.List({.limit = 2});
  EXPECT_THAT(Ids(page), ElementsAre("d", "c"));
  EXPECT_THAT(
      Ids(*store.List({.before_number = page.back().number, .limit = 2})),
      ElementsAre("b", "a"));
}

TEST(MemoryJobStoreTest, ListsOnlyJobsThatHaveAllLabels) {
  MemoryJobStore store;
  JobRecord job = NewJob("a");
  job.labels = {{"pose", "walk"}, {"user", "x"}};
  ASSERT_THAT(store.Insert(job), IsOk());
  job = NewJob("b");
  job.labels = {{"pose", "walk"}};
  ASSERT_THAT(store.Insert(job), IsOk());
  job = NewJob("c");
  job.labels = {{"pose", "run"}, {"user", "x"}};
  ASSERT_THAT(store.Insert(job), IsOk());
  const auto with = [&](const std::map<std::string, std::string>& labels) {
    return Ids(*store.List({.limit = 10, .labels = labels}));
  };
  EXPECT_THAT(with({}), ElementsAre("c", "b", "a"));
  EXPECT_THAT(with({{"pose", "walk"}}), ElementsAre("b", "a"));
  EXPECT_THAT(with({{"pose", "walk"}, {"user", "x"}}), ElementsAre("a"));
  EXPECT_THAT(with({{"pose", ""}}), IsEmpty());
  // The page is full of jobs that match, not of jobs that were looked at.
  EXPECT_THAT(Ids(*store.List({.limit = 1, .labels = {{"pose", "walk"}}})),
              ElementsAre("b"));
}

TEST(MemoryJobStoreTest, OnlyTerminalJobsAreDeleted) {
  MemoryJobStore store;
  ASSERT_THAT(store.Insert(NewJob("a", "r")), IsOk());
  EXPECT_THAT(store.Delete("a"),
              StatusIs(absl::StatusCode::kFailedPrecondition, _));
  Succeed(store, "a", 1);
  EXPECT_THAT(store.Delete("a"), IsOk());
  EXPECT_THAT(store.Delete("a"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store.FindByRequestId("", "r"),
              StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(*store.List({}), IsEmpty());
}

TEST(MemoryJobStoreTest, PruneRemovesTheFirstThatEndedAndNoOthers) {
  MemoryJobStore store;
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed(store, "c", 10);
  Succeed(store, "a", 10);
  Succeed(store, "b", 10);
  EXPECT_THAT(Ids(*store.Prune({.max_jobs = 3, .max_result_bytes = 30})),
              IsEmpty());
  EXPECT_THAT(Ids(*store.Prune({.max_jobs = 2, .max_result_bytes = 30})),
              ElementsAre("c"));
  EXPECT_THAT(Ids(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              ElementsAre("a"));
  EXPECT_THAT(Ids(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              IsEmpty());
  EXPECT_THAT(Ids(*store.List({})), ElementsAre("d", "b"));
}

TEST(MemoryJobStoreTest, TheLastToEndIsKeptHoweverLargeItsResult) {
  MemoryJobStore store;
  for (const char* id : {"a", "b"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
    Succeed(store, id, 1000);
  }
  EXPECT_THAT(Ids(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              ElementsAre("a"));
  EXPECT_THAT(Ids(*store.List({})), ElementsAre("b"));
}

TEST(MemoryJobStoreTest, PruneRemovesAllThatEndedTooLongAgo) {
  MemoryJobStore store;
  for (const char* id : {"a", "b", "c"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  const absl::Time now = absl::UnixEpoch();
  for (const auto& [id, end] :
       {std::pair("a", now), std::pair("b", now + absl::Seconds(5))}) {
    JobRecord record = *store.Get(id);
    record.state = JobState::kFailed;
    record.end_time = end;
    ASSERT_THAT(store.Update(record), IsOk());
  }
  EXPECT_THAT(Ids(*store.Prune({.ended_before = now})), IsEmpty());
  EXPECT_THAT(Ids(*store.Prune({.ended_before = now + absl::Seconds(1)})),
              ElementsAre("a"));
  EXPECT_THAT(Ids(*store.Prune({.ended_before = now + absl::Hours(1)})),
              ElementsAre("b"));
  EXPECT_THAT(Ids(*store.List({})), ElementsAre("c"));
}

TEST(MemoryJobStoreTest, ManyAreRemovedAsFarAsTheDiskGoes) {
  FakeJournal journal;
  int errors = 0;
  MemoryJobStore store({}, &journal, [&](const absl::Status&) { ++errors; });
  for (int i = 0; i < 100; ++i) {
    ASSERT_THAT(store.Insert(NewJob(std::to_string(i))), IsOk());
    Succeed(store, std::to_string(i), 10);
  }
  const KeepLimits all = {.ended_before = absl::InfiniteFuture()};
  journal.removals_left = 2;
  EXPECT_THAT(*store.Prune(all), testing::SizeIs(64));
  EXPECT_EQ(errors, 1);
  EXPECT_THAT(*store.List({}), testing::SizeIs(36));
  EXPECT_THAT(journal.kept, testing::SizeIs(36));
  journal.removals_left = 2;
  EXPECT_THAT(*store.Prune(all), testing::SizeIs(36));
  EXPECT_EQ(errors, 1);
}

TEST(MemoryJobStoreTest, FlushingSettlesTheJournal) {
  FakeJournal journal;
  MemoryJobStore store({}, &journal, [](const absl::Status&) {});
  store.Flush();
  EXPECT_EQ(journal.settled, 1);
}

TEST(MemoryJobStoreTest, TenantsHaveTheirOwnRequestsAndLists) {
  MemoryJobStore store;
  JobRecord a = NewJob("a", "r");
  a.tenant = "one";
  JobRecord b = NewJob("b", "r");
  b.tenant = "two";
  ASSERT_THAT(store.Insert(a), IsOk());
  ASSERT_THAT(store.Insert(b), IsOk());
  EXPECT_EQ(store.FindByRequestId("one", "r")->id, "a");
  EXPECT_EQ(store.FindByRequestId("two", "r")->id, "b");
  EXPECT_THAT(Ids(*store.List({.tenant = "two"})), ElementsAre("b"));
  EXPECT_THAT(Ids(*store.List({})), ElementsAre("b", "a"));
}

TEST(MemoryJobStoreTest, ProgressDoesNotWaitForADiskThatStalls) {
  FakeJournal journal;
  MemoryJobStore store({}, &journal, [](const absl::Status&) {});
  JobRecord changing = *store.Insert(NewJob("a"));
  JobRecord other = *store.Insert(NewJob("b"));
  absl::Status of_other;
  absl::Status of_same;
  // On another thread: on this one a lock would be taken twice.
  journal.during_write = [&] {
    std::thread([&] {
      other.progress.total_fraction = 0.5;
      of_other = store.Update(other).status();
      JobRecord same = *store.Get("a");
      same.progress.total_fraction = 0.5;
      of_same = store.Update(same).status();
    }).join();
  };
  changing.state = JobState::kRunning;
  const auto changed = store.Update(changing);
  ASSERT_THAT(changed, IsOk());
  EXPECT_THAT(of_other, IsOk());
  EXPECT_EQ(store.Get("b")->progress.total_fraction, 0.5);
  // Nothing comes between a change and the disk.
  EXPECT_FALSE(of_same.ok());
  EXPECT_EQ(store.Get("a")->progress.total_fraction, 0);
  journal.during_write = nullptr;
  changing = *changed;
  changing.progress.total_fraction = 0.25;
  EXPECT_THAT(store.Update(changing), IsOk());
}

TEST(MemoryJobStoreTest, OnlyChangesOfStateAreWrittenToTheJournal) {
  FakeJournal journal;
  MemoryJobStore store({}, &journal, [](const absl::Status&) {});
  JobRecord record = *store.Insert(NewJob("a"));
  EXPECT_EQ(journal.writes, 1);
  record.progress.total_fraction = 0.5;
  record = *store.Update(record);
  EXPECT_EQ(journal.writes, 1);
  record.state = JobState::kRunning;
  ASSERT_THAT(store.Update(record), IsOk());
  EXPECT_EQ(journal.writes, 2);
  EXPECT_EQ(journal.kept.at("a").progress.total_fraction, 0.5);
}

TEST(MemoryJobStoreTest, KnowsWhichBlobsJobsOfATenantName) {
  MemoryJobStore store;
  JobRecord record;
  record.id = "inputs";
  record.tenant = "lab";
  record.inputs = {"request", "mesh"};
  ASSERT_THAT(store.Insert(record), IsOk());
  EXPECT_TRUE(*store.HasInput("lab", "mesh"));
  EXPECT_FALSE(*store.HasInput("lab", "other"));
  EXPECT_FALSE(*store.HasInput("others", "mesh"));
}

}  // namespace
}  // namespace isomatch
