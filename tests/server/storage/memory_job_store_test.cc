#include "server/storage/memory_job_store.h"

#include <memory>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/base/sha256.h"
#include "tests/server/storage/fake_journal.h"
#include "tests/server/storage/job_store_conformance.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;

/// Makes the job SUCCEEDED with a result of `bytes`.
void Succeed(MemoryJobStore& store, const std::string& id, int bytes) {
  JobRecord record = *store.Get(id);
  record.state = JobState::kSucceeded;
  // In two parts.
  record.result.emplace().parts = {{ResultPart::kMap, "", 1},
                                   {ResultPart::kConfidence, "", bytes - 1}};
  ASSERT_THAT(store.Update(record), IsOk());
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
  EXPECT_THAT(IdsOf(*store.Prune({.ended_before = now})), IsEmpty());
  EXPECT_THAT(IdsOf(*store.Prune({.ended_before = now + absl::Seconds(1)})),
              ElementsAre("a"));
  EXPECT_THAT(IdsOf(*store.Prune({.ended_before = now + absl::Hours(1)})),
              ElementsAre("b"));
  EXPECT_THAT(IdsOf(*store.List({})), ElementsAre("c"));
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

/// A store that needs no blobs.
class KeptMemoryJobStore : public KeptJobStore {
 public:
  JobStore& store() override { return store_; }
  std::string Put(const std::string&, const std::string& bytes) override {
    return Sha256Hex(bytes);
  }

 private:
  MemoryJobStore store_;
};

INSTANTIATE_TEST_SUITE_P(Memory, JobStoreTest,
                         testing::Values(JobStoreKind{
                             "Memory", [] {
                               return std::make_unique<KeptMemoryJobStore>();
                             }}));

}  // namespace
}  // namespace isomatch
