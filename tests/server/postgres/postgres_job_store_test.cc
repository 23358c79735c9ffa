#include "server/postgres/postgres_job_store.h"

#include <atomic>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pqxx/pqxx>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "core/base/mutex.h"
#include "core/base/sha256.h"
#include "tests/server/postgres/postgres_queue_fixture.h"
#include "tests/server/storage/job_store_conformance.h"
#include "tests/support/matchers.h"

namespace isomatch {
namespace {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;

absl::StatusOr<std::unique_ptr<KeptJobStore>> OpenKept() {
  auto pool = NewDatabase();
  if (!pool.ok()) return pool.status();
  return std::make_unique<KeptPostgresJobStore>(*std::move(pool));
}

INSTANTIATE_TEST_SUITE_P(Postgres, JobStoreTest,
                         testing::Values(JobStoreKind{"Postgres", OpenKept}));

TEST_F(PostgresQueueTest, AClaimMakesAJobRunningWithANumberOfItsOwn) {
  Insert(Job("a"));
  const auto claimed = store().Claim(Asking());
  ASSERT_THAT(claimed, IsOk());
  ASSERT_TRUE(claimed->has_value());
  EXPECT_EQ((*claimed)->state, JobState::kRunning);
  EXPECT_EQ((*claimed)->attempt, 1);
  EXPECT_EQ((*claimed)->worker, "w");
  EXPECT_NE((*claimed)->claim, 0);
  EXPECT_EQ(store().Get("a")->claim, (*claimed)->claim);
  EXPECT_EQ(ClaimId(), "none");
}

TEST_F(PostgresQueueTest, TenantsTakeTurnsAndPrioritiesCountWithinThem) {
  for (const char* id : {"a1", "a2", "a3", "a4"}) Insert(Job(id, "a"));
  Insert(Job("a5", "a", 9));
  Insert(Job("b1", "b"));
  Insert(Job("b2", "b"));
  EXPECT_THAT(*store().InOrder(),
              ElementsAre("a5", "b1", "a1", "b2", "a2", "a3", "a4"));
  std::vector<std::string> started;
  for (int i = 0; i < 7; ++i) started.push_back(ClaimId());
  EXPECT_THAT(started, ElementsAre("a5", "b1", "a1", "b2", "a2", "a3", "a4"));
}

TEST_F(PostgresQueueTest, TheTenantThatRunsFewestIsNext) {
  for (const char* id : {"a1", "a2"}) Insert(Job(id, "a"));
  EXPECT_EQ(ClaimId(), "a1");
  Insert(Job("b1", "b"));
  Insert(Job("b2", "b"));
  EXPECT_EQ(ClaimId(), "b1");
  JobRecord done = *store().Get("b1");
  done.state = JobState::kCancelled;
  ASSERT_THAT(store().Update(done), IsOk());
  EXPECT_EQ(ClaimId(), "b2");  // of a, one still runs
}

TEST_F(PostgresQueueTest, ATenantStartsNoMoreThanItMay) {
  for (const char* id : {"a1", "a2"}) Insert(Job(id, "a"));
  ClaimRequest request = Asking();
  request.max_running_per_tenant = 1;
  EXPECT_EQ(ClaimId(request), "a1");
  EXPECT_EQ(ClaimId(request), "none");
}

TEST_F(PostgresQueueTest, SharedPrioritiesOvertakeButNotForEver) {
  for (int i = 0; i < 20; ++i) {
    JobRecord job = Job(absl::StrCat("high", i), "high");
    job.shared_priority = 5;
    Insert(job);
  }
  Insert(Job("low", "low"));
  int before = 0;
  while (ClaimId() != "low") ASSERT_LT(++before, 20);
  EXPECT_EQ(before, 8);
}

TEST_F(PostgresQueueTest, WhatDoesNotFitIsPassedSoManyTimesOnly) {
  Insert(Job("large", "a", 0, 90));
  for (int i = 0; i < 12; ++i) Insert(Job(absl::StrCat("s", i), "a"));
  int passes = 0;
  while (ClaimId(Asking(50)) != "none") ++passes;
  EXPECT_EQ(passes, 8);
  EXPECT_EQ(ClaimId(Asking(100)), "large");
  EXPECT_EQ(ClaimId(Asking(50)), "s8");
}

TEST_F(PostgresQueueTest, WhatNeverFitsWaitsForALargerWorker) {
  Insert(Job("huge", "a", 0, 1000));
  for (int i = 0; i < 12; ++i) Insert(Job(absl::StrCat("s", i), "a"));
  for (int i = 0; i < 12; ++i) EXPECT_EQ(ClaimId(), absl::StrCat("s", i));
  EXPECT_EQ(ClaimId(), "none");
  ClaimRequest larger = Asking(2000);
  larger.total_bytes = 2000;
  EXPECT_EQ(ClaimId(larger), "huge");
}

TEST_F(PostgresQueueTest, AWorkerPrefersMeshesThatItHasPrepared) {
  const std::string known = kept_->Put("a", "known");
  const std::string other = kept_->Put("a", "other");
  for (int i = 0; i < 12; ++i) {
    JobRecord job = Job(absl::StrCat("j", i), "a");
    job.inputs = {i % 2 == 0 ? other : known};
    Insert(job);
  }
  ClaimRequest request = Asking();
  request.meshes = {known};
  std::vector<std::string> started;
  for (int i = 0; i < 5; ++i) started.push_back(ClaimId(request));
  // Of the next eight each time, and j0 is passed no more than eight times.
  EXPECT_THAT(started, ElementsAre("j1", "j3", "j5", "j7", "j9"));
  request.max_passes = 5;
  EXPECT_EQ(ClaimId(request), "j0");
}

TEST_F(PostgresQueueTest, AJobThatWasStartedOftenRunsAlone) {
  JobRecord job = Insert(Job("a"));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(*store().TakeBack(ClaimAndExpire("a"), 0));
  }
  EXPECT_EQ(ClaimId(Asking(99)), "none");
  EXPECT_EQ(ClaimId(Asking(100)), "a");
}

TEST_F(PostgresQueueTest, AJobThatIsHeldWaits) {
  Insert(Job("a"));
  ASSERT_EQ(ClaimId(), "a");
  JobRecord back = *store().Get("a");
  back.state = JobState::kQueued;
  --back.attempt;
  back.hold = absl::Milliseconds(300);
  ASSERT_THAT(store().Update(back), IsOk());
  EXPECT_TRUE(store().Get("a")->is_held);
  EXPECT_EQ(ClaimId(), "none");
  absl::SleepFor(absl::Milliseconds(400));
  EXPECT_EQ(ClaimId(), "a");
  EXPECT_EQ(store().Get("a")->attempt, 1);
}

TEST_F(PostgresQueueTest, AClaimThatWaitedHearsOfAJobThatCameMeanwhile) {
  Insert(Job("early"));
  const auto other = (*TheServer())->url();
  pqxx::connection connection(other);
  pqxx::work lock(connection);
  lock.exec("SELECT pg_advisory_xact_lock(22062021)");  // as claims do
  std::string claimed;
  std::jthread claim([&] { claimed = ClaimId(); });
  const auto is_waiting = [&] {
    return lock.exec(
                   "SELECT count(*) FROM pg_locks WHERE locktype = 'advisory' "
                   "AND NOT granted")[0][0]
               .as<int>() > 0;
  };
  while (!is_waiting()) absl::SleepFor(absl::Milliseconds(5));
  Insert(Job("urgent", "t", /*priority=*/5));
  lock.commit();
  claim.join();
  EXPECT_EQ(claimed, "urgent");
}

TEST_F(PostgresQueueTest, NoClaimWaitsWhereNothingFitsTheWorker) {
  Insert(Job("large", "t", 0, /*bytes=*/1000));
  pqxx::connection connection((*TheServer())->url());
  pqxx::work lock(connection);
  lock.exec("SELECT pg_advisory_xact_lock(22062021)");
  EXPECT_EQ(ClaimId(), "none");
}

TEST_F(PostgresQueueTest, WhatARemovedJobLeavesIsDueEvenIfNobodyRemovesIt) {
  JobRecord job = Job("a");
  job.inputs = {kept_->Put("t", "request"), kept_->Put("t", "mesh")};
  Insert(job);
  JobRecord ended = *store().Claim(Asking()).value();
  ended.state = JobState::kSucceeded;
  ended.result.emplace().parts = {
      {ResultPart::kMap, kept_->Put("t", "map"), 3}};
  ASSERT_THAT(store().Update(ended), IsOk());
  ASSERT_THAT(store().Delete("a"), IsOk());
  const auto due = kept_->pool().Ask(
      PostgresPool::Repeat::kOnce,
      "SELECT bytes FROM isomatch.blobs WHERE remove_at IS NOT NULL "
      "ORDER BY bytes");
  ASSERT_THAT(due, IsOk());
  ASSERT_EQ(due->size(), 2);  // not the mesh, which others may name
  EXPECT_EQ((*due)[0][0].as<int>(), 3);
  EXPECT_EQ((*due)[1][0].as<int>(), 7);
}

TEST_F(PostgresQueueTest, ManyThatAreTooOldGoInPieces) {
  const auto insert = kept_->pool().Ask(
      PostgresPool::Repeat::kOnce,
      "INSERT INTO isomatch.jobs (id, number, tenant, request_id, state, "
      "sequence, created, ended, labels, inputs, record) SELECT 'old-' || i, "
      "1000000 + i, 't', '', 4, i, now(), now() - interval '1 day', '{}', "
      "'{}', '' FROM generate_series(1, 12000) AS i");
  ASSERT_THAT(insert, IsOk());
  Insert(Job("live"));
  const auto removed = store().Prune({.max_jobs = 1});
  ASSERT_THAT(removed, IsOk());
  EXPECT_THAT(*removed, SizeIs(10000));
  EXPECT_THAT(*store().Prune({.max_jobs = 1}), SizeIs(1999));
  EXPECT_THAT(*store().Prune({.max_jobs = 1}), IsEmpty());
  EXPECT_THAT(store().Get("live"), IsOk());
}

TEST_F(PostgresQueueTest, TheNextWorkerKnowsHowOftenAJobWasHeld) {
  Insert(Job("a"));
  const auto claim_and_hold = [&](absl::Duration hold, int unreadable) {
    JobRecord job = **store().Claim(Asking());
    const std::pair known(job.times_held, job.unreadable);
    job.state = JobState::kQueued;
    job.hold = hold;
    job.unreadable = unreadable;
    EXPECT_THAT(store().Update(job), IsOk());
    absl::SleepFor(hold);
    return known;
  };
  constexpr absl::Duration kMoment = absl::Milliseconds(20);
  EXPECT_EQ(claim_and_hold(kMoment, 1), std::pair(0, 0));
  EXPECT_EQ(claim_and_hold(kMoment, 2), std::pair(1, 1));
  EXPECT_EQ(claim_and_hold(kMoment, 0), std::pair(2, 2));
  EXPECT_EQ(claim_and_hold(absl::ZeroDuration(), 0), std::pair(3, 0));
  EXPECT_EQ(claim_and_hold(absl::ZeroDuration(), 0), std::pair(3, 0));
}

TEST_F(PostgresQueueTest, QueueTimeoutsAndWatchersCountByTheDatabasesClock) {
  JobRecord hasty = Job("hasty");
  hasty.queue_timeout = absl::Milliseconds(50);
  Insert(hasty);
  JobRecord shy = Job("shy");
  shy.cancel_when_unwatched = true;
  Insert(shy);
  Insert(Job("other"));
  EXPECT_THAT(*store().Unwatched(), IsEmpty());
  absl::SleepFor(absl::Milliseconds(300));
  EXPECT_THAT(*store().Unwatched(), ElementsAre("shy"));
  ASSERT_THAT(store().KeepWatched({"shy", "other"}, absl::Seconds(9)), IsOk());
  EXPECT_THAT(*store().Unwatched(), IsEmpty());
  const auto overdue = store().Overdue();
  ASSERT_THAT(overdue, IsOk());
  ASSERT_THAT(*overdue, SizeIs(1));
  EXPECT_EQ(overdue->front().id, "hasty");
}

TEST_F(PostgresQueueTest, WorkersAndChoresAreKnownToAll) {
  ASSERT_THAT(store().Register({"one", "1", 2, 4, 100}), IsOk());
  ASSERT_THAT(store().Register({"two", "1", 1, 8, 300}), IsOk());
  EXPECT_THAT(*store().Workers(absl::Seconds(30)), SizeIs(2));
  ASSERT_THAT(store().Unregister("one"), IsOk());
  const WorkerEntry left = store().Workers(absl::Seconds(30))->front();
  EXPECT_EQ(left.worker, "two");
  EXPECT_EQ(left.slots, 1);
  EXPECT_EQ(left.threads, 8);
  EXPECT_EQ(left.memory_bytes, 300);
  EXPECT_TRUE(*store().HoldChore("c", "one", absl::Milliseconds(100)));
  EXPECT_FALSE(*store().HoldChore("c", "two", absl::Milliseconds(100)));
  EXPECT_TRUE(*store().HoldChore("c", "one", absl::Milliseconds(100)));
  absl::SleepFor(absl::Milliseconds(150));
  EXPECT_TRUE(*store().HoldChore("c", "two", absl::Milliseconds(100)));
}

TEST_F(PostgresQueueTest, CountsWhatWaitsAndRuns) {
  Insert(Job("a", "t", 1));
  Insert(Job("b", "t", 1));
  Insert(Job("c", "u"));
  ASSERT_EQ(ClaimId(), "a");
  const auto counts = store().Count();
  ASSERT_THAT(counts, IsOk());
  EXPECT_EQ(counts->queued, 2);
  EXPECT_EQ(counts->running, 1);
  EXPECT_THAT(counts->queued_by_priority,
              UnorderedElementsAre(std::pair(0, 1), std::pair(1, 1)));
  EXPECT_EQ(*store().CountQueuedOf("t"), 1);
}

TEST_F(PostgresQueueTest, EachJobIsClaimedOnceByManyWorkers) {
  constexpr int kJobs = 200;
  for (int i = 0; i < kJobs; ++i) {
    Insert(Job(absl::StrCat("j", i), absl::StrCat("t", i % 7)));
  }
  Mutex mutex;
  std::multiset<std::string> claimed;
  std::vector<std::thread> workers;
  for (int w = 0; w < 6; ++w) {
    workers.emplace_back([&] {
      while (true) {
        const std::string id = ClaimId();
        if (id == "none") return;
        MutexLock lock(mutex);
        claimed.insert(id);
      }
    });
  }
  for (std::thread& worker : workers) worker.join();
  EXPECT_EQ(claimed.size(), kJobs);
  EXPECT_EQ(std::set<std::string>(claimed.begin(), claimed.end()).size(),
            kJobs);
}

TEST_F(PostgresQueueTest, AJobWithoutItsBlobsIsRefused) {
  JobRecord job = Job("a");
  job.inputs = {Sha256Hex("nowhere")};
  EXPECT_THAT(store().Insert(job),
              StatusIs(absl::StatusCode::kFailedPrecondition, _));
  EXPECT_THAT(store().Get("a"), StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_F(PostgresQueueTest, AJobThatEndsWhileItIsDeletedStays) {
  Insert(Job("a"));
  absl::Status deleted;
  std::atomic<bool> is_done = false;
  std::thread deletes;
  ASSERT_THAT(kept_->pool().Run([&](pqxx::work& other) {
    // Who deletes sees that the job is not over, and stops here.
    other.exec("LOCK TABLE isomatch.job_blobs IN EXCLUSIVE MODE");
    deletes = std::thread([&] {
      deleted = store().Delete("a").status();
      is_done = true;
    });
    const auto waits = [&] {
      return other.exec("SELECT FROM pg_locks WHERE NOT granted").size();
    };
    while (!is_done && waits() == 0) {
    }
    other.exec("DELETE FROM isomatch.live_jobs");
    other.exec("UPDATE isomatch.jobs SET state = 5, ended = now()");
    return absl::OkStatus();
  }),
              IsOk());
  deletes.join();
  EXPECT_THAT(deleted, StatusIs(absl::StatusCode::kFailedPrecondition, _));
  EXPECT_THAT(store().Get("a"), IsOk());
  EXPECT_THAT(store().Delete("a"), IsOk());
}

TEST_F(PostgresQueueTest, AClaimThatACrashTakesBackIsNeverGivenAgain) {
  auto server = TheServer();
  ASSERT_THAT(server, IsOk());
  int taken_back = 0;
  for (int round = 0; round < 5; ++round) {
    const std::string id = absl::StrCat("j", round);
    Insert(Job(id));
    // The next number of the sequence is one that the crash takes back, too.
    for (const char* const sql : {"SELECT setval('isomatch.job_sequence', "
                                  "nextval('isomatch.job_sequence'))",
                                  "CHECKPOINT"}) {
      ASSERT_THAT(kept_->pool().Ask(PostgresPool::Repeat::kOnce, sql), IsOk());
    }
    const auto first = store().Claim(Asking());
    (*server)->Kill();
    ASSERT_THAT(first, IsOk());
    ASSERT_TRUE(first->has_value());
    ASSERT_THAT((*server)->Restart(), IsOk());
    const auto again = store().Get(id);
    ASSERT_THAT(again, IsOk());
    if (again->state == JobState::kQueued) {
      ++taken_back;
      const auto second = store().Claim(Asking());
      ASSERT_TRUE(second.ok() && second->has_value());
      EXPECT_NE((*second)->claim, (*first)->claim) << "so it is no fence";
    }
    JobRecord ended = *store().Get(id);
    ended.state = JobState::kCancelled;
    ASSERT_THAT(store().Update(ended), IsOk());
  }
  EXPECT_GT(taken_back, 0) << "the test did not see what it is about";
}

TEST_F(PostgresQueueTest, ADatabaseThatWasAwayIsAskedAgain) {
  auto server = TheServer();
  ASSERT_THAT(server, IsOk());
  Insert(Job("a"));
  (*server)->Kill();
  EXPECT_THAT(store().Get("a"), StatusIs(absl::StatusCode::kUnavailable, _));
  EXPECT_THAT(store().Claim(Asking()),
              StatusIs(absl::StatusCode::kUnavailable, _));
  ASSERT_THAT((*server)->Restart(), IsOk());
  EXPECT_THAT(store().Get("a"), IsOk());
  EXPECT_EQ(ClaimId(), "a");
}

}  // namespace
}  // namespace isomatch
