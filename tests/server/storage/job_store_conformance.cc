#include "tests/server/storage/job_store_conformance.h"

#include <atomic>
#include <cstdint>
#include <map>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/matchers.h"

namespace isomatch {

using testing::_;
using testing::ElementsAre;
using testing::IsEmpty;

void JobStoreTest::SetUp() {
  auto opened = GetParam().open();
  ASSERT_THAT(opened, IsOk());
  kept_ = *std::move(opened);
}

void JobStoreTest::Succeed(const std::string& id, int bytes) {
  JobRecord record = *kept_->store().Get(id);
  record.state = JobState::kSucceeded;
  // In two parts.
  const std::string map = kept_->Put(record.tenant, "map");
  const std::string confidence = kept_->Put(record.tenant, "confidence");
  record.result.emplace().parts = {
      {ResultPart::kMap, map, 1},
      {ResultPart::kConfidence, confidence, bytes - 1}};
  ASSERT_THAT(kept_->store().Update(record), IsOk());
}

TEST_P(JobStoreTest, SequencesGrowWithEveryChangeOfAnyJob) {
  JobStore& store = kept_->store();
  const JobRecord a = *store.Insert(NewJob("a"));
  const JobRecord b = *store.Insert(NewJob("b"));
  const JobRecord a2 = *store.Update(a);
  EXPECT_LT(a.sequence, b.sequence);
  EXPECT_LT(b.sequence, a2.sequence);
  EXPECT_EQ(a.number, a2.number);
}

TEST_P(JobStoreTest, AnUpdateOfAnOldSequenceIsAborted) {
  JobStore& store = kept_->store();
  const JobRecord old = *store.Insert(NewJob("a"));
  ASSERT_THAT(store.Update(old), IsOk());
  EXPECT_THAT(store.Update(old), StatusIs(absl::StatusCode::kAborted, _));
  EXPECT_THAT(store.Update(NewJob("b")),
              StatusIs(absl::StatusCode::kNotFound, _));
}

TEST_P(JobStoreTest, IdsAndRequestIdsAreUnique) {
  JobStore& store = kept_->store();
  ASSERT_THAT(store.Insert(NewJob("a", "r")), IsOk());
  EXPECT_THAT(store.Insert(NewJob("a")),
              StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(store.Insert(NewJob("b", "r")),
              StatusIs(absl::StatusCode::kAlreadyExists, _));
  EXPECT_THAT(store.Insert(NewJob("c")), IsOk());
  EXPECT_THAT(store.Insert(NewJob("d")), IsOk());  // no request_id, twice
  EXPECT_EQ(store.FindByRequestId("", "r")->id, "a");
}

TEST_P(JobStoreTest, ListsNewestFirstByStateAndInPages) {
  JobStore& store = kept_->store();
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed("b", 0);
  EXPECT_THAT(IdsOf(*store.List({})), ElementsAre("d", "c", "b", "a"));
  EXPECT_THAT(IdsOf(*store.List({.states = {JobState::kSucceeded}})),
              ElementsAre("b"));
  const auto page = *store.List({.limit = 2});
  EXPECT_THAT(IdsOf(page), ElementsAre("d", "c"));
  EXPECT_THAT(
      IdsOf(*store.List({.before_number = page.back().number, .limit = 2})),
      ElementsAre("b", "a"));
}

TEST_P(JobStoreTest, ListsOnlyJobsThatHaveAllLabels) {
  JobStore& store = kept_->store();
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
    return IdsOf(*store.List({.limit = 10, .labels = labels}));
  };
  EXPECT_THAT(with({}), ElementsAre("c", "b", "a"));
  EXPECT_THAT(with({{"pose", "walk"}}), ElementsAre("b", "a"));
  EXPECT_THAT(with({{"pose", "walk"}, {"user", "x"}}), ElementsAre("a"));
  EXPECT_THAT(with({{"pose", ""}}), IsEmpty());
  // The page is full of jobs that match, not of jobs that were looked at.
  EXPECT_THAT(IdsOf(*store.List({.limit = 1, .labels = {{"pose", "walk"}}})),
              ElementsAre("b"));
}

TEST_P(JobStoreTest, AnyByteOfATextIsLookedFor) {
  JobStore& store = kept_->store();
  const std::string zero("r\0", 2);
  const std::string one("r\1\2", 3);
  JobRecord job = NewJob("a", zero);
  job.labels = {{zero, "x"}};
  ASSERT_THAT(store.Insert(job), IsOk());
  ASSERT_THAT(store.Insert(NewJob("b", one)), IsOk());
  EXPECT_EQ(store.FindByRequestId("", zero)->request_id, zero);
  EXPECT_EQ(store.FindByRequestId("", one)->id, "b");
  EXPECT_THAT(IdsOf(*store.List({.labels = {{zero, "x"}}})), ElementsAre("a"));
}

TEST_P(JobStoreTest, OnlyTerminalJobsAreDeleted) {
  JobStore& store = kept_->store();
  ASSERT_THAT(store.Insert(NewJob("a", "r")), IsOk());
  EXPECT_THAT(store.Delete("a"),
              StatusIs(absl::StatusCode::kFailedPrecondition, _));
  Succeed("a", 1);
  EXPECT_THAT(store.Delete("a"), IsOk());
  EXPECT_THAT(store.Delete("a"), StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(store.FindByRequestId("", "r"),
              StatusIs(absl::StatusCode::kNotFound, _));
  EXPECT_THAT(*store.List({}), IsEmpty());
}

TEST_P(JobStoreTest, PruneRemovesTheFirstThatEndedAndNoOthers) {
  JobStore& store = kept_->store();
  for (const char* id : {"a", "b", "c", "d"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
  }
  Succeed("c", 10);
  Succeed("a", 10);
  Succeed("b", 10);
  EXPECT_THAT(IdsOf(*store.Prune({.max_jobs = 3, .max_result_bytes = 30})),
              IsEmpty());
  EXPECT_THAT(IdsOf(*store.Prune({.max_jobs = 2, .max_result_bytes = 30})),
              ElementsAre("c"));
  EXPECT_THAT(IdsOf(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              ElementsAre("a"));
  EXPECT_THAT(IdsOf(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              IsEmpty());
  EXPECT_THAT(IdsOf(*store.List({})), ElementsAre("d", "b"));
}

TEST_P(JobStoreTest, TheLastToEndIsKeptHoweverLargeItsResult) {
  JobStore& store = kept_->store();
  for (const char* id : {"a", "b"}) {
    ASSERT_THAT(store.Insert(NewJob(id)), IsOk());
    Succeed(id, 1000);
  }
  EXPECT_THAT(IdsOf(*store.Prune({.max_jobs = 2, .max_result_bytes = 10})),
              ElementsAre("a"));
  EXPECT_THAT(IdsOf(*store.List({})), ElementsAre("b"));
}

TEST_P(JobStoreTest, TenantsHaveTheirOwnRequestsAndLists) {
  JobStore& store = kept_->store();
  JobRecord a = NewJob("a", "r");
  a.tenant = "one";
  JobRecord b = NewJob("b", "r");
  b.tenant = "two";
  ASSERT_THAT(store.Insert(a), IsOk());
  ASSERT_THAT(store.Insert(b), IsOk());
  EXPECT_EQ(store.FindByRequestId("one", "r")->id, "a");
  EXPECT_EQ(store.FindByRequestId("two", "r")->id, "b");
  EXPECT_THAT(IdsOf(*store.List({.tenant = "two"})), ElementsAre("b"));
  EXPECT_THAT(IdsOf(*store.List({})), ElementsAre("b", "a"));
}

TEST_P(JobStoreTest, KnowsWhichBlobsJobsOfATenantName) {
  JobStore& store = kept_->store();
  JobRecord record;
  record.id = "inputs";
  record.tenant = "lab";
  const std::string mesh = kept_->Put("lab", "mesh");
  record.inputs = {kept_->Put("lab", "request"), mesh};
  ASSERT_THAT(store.Insert(record), IsOk());
  EXPECT_TRUE(*store.HasInput("lab", mesh));
  EXPECT_FALSE(*store.HasInput("lab", "other"));
  EXPECT_FALSE(*store.HasInput("others", mesh));
}

TEST_P(JobStoreTest, WhatWasStoredComesBack) {
  JobStore& store = kept_->store();
  JobRecord job = NewJob("a", "r");
  job.tenant = "lab";
  job.call_id = "call";
  job.trace_parent = "trace";
  job.request_sha256 = "digest";
  job.labels = {{"pose", "\"walk\" \\ {,}"}};
  job.priority = 7;
  job.shared_priority = 3;
  job.memory_estimate_bytes = std::int64_t{1} << 40;
  job.threads = 2;
  job.queue_timeout = absl::Seconds(5);
  job.run_timeout = absl::Minutes(3);
  job.deadline = absl::Milliseconds(300);
  job.cancel_when_unwatched = true;
  job.inputs = {kept_->Put("lab", "request"), kept_->Put("lab", "mesh")};
  ASSERT_THAT(store.Insert(job), IsOk());
  const auto read = store.Get("a");
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ(read->state, JobState::kQueued);
  EXPECT_EQ(read->tenant, job.tenant);
  EXPECT_EQ(read->call_id, job.call_id);
  EXPECT_EQ(read->trace_parent, job.trace_parent);
  EXPECT_EQ(read->request_sha256, job.request_sha256);
  EXPECT_EQ(read->labels, job.labels);
  EXPECT_EQ(read->priority, job.priority);
  EXPECT_EQ(read->shared_priority, job.shared_priority);
  EXPECT_EQ(read->memory_estimate_bytes, job.memory_estimate_bytes);
  EXPECT_EQ(read->threads, job.threads);
  EXPECT_EQ(read->queue_timeout, job.queue_timeout);
  EXPECT_EQ(read->run_timeout, job.run_timeout);
  EXPECT_EQ(read->deadline, job.deadline);
  EXPECT_TRUE(read->cancel_when_unwatched);
  EXPECT_EQ(read->inputs, job.inputs);
}

TEST_P(JobStoreTest, TheEndOfAJobIsKeptWithItsReason) {
  JobStore& store = kept_->store();
  JobRecord job = *store.Insert(NewJob("a"));
  job.state = JobState::kFailed;
  job.error = {absl::StatusCode::kInternal, "WHY", "because"};
  job.faults = 2;
  ASSERT_THAT(store.Update(job), IsOk());
  const auto read = store.Get("a");
  ASSERT_THAT(read, IsOk());
  EXPECT_EQ(read->state, JobState::kFailed);
  ASSERT_TRUE(read->error.has_value());
  EXPECT_EQ(read->error->reason, "WHY");
  EXPECT_EQ(read->faults, 2);
  EXPECT_THAT(store.Update(job), StatusIs(absl::StatusCode::kAborted, _));
}

TEST_P(JobStoreTest, OfTwoChangesOfOneRecordOneHolds) {
  JobStore& store = kept_->store();
  const JobRecord job = *store.Insert(NewJob("a"));
  constexpr int kWriters = 8;
  std::atomic<int> held = 0;
  std::vector<std::thread> writers;
  for (int i = 0; i < kWriters; ++i) {
    writers.emplace_back([&, i] {
      JobRecord mine = job;
      mine.state = i % 2 == 0 ? JobState::kCancelled : JobState::kFailed;
      const absl::Status status = store.Update(mine).status();
      if (status.ok()) ++held;
      EXPECT_TRUE(status.ok() || absl::IsAborted(status)) << status;
    });
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_EQ(held, 1);
}

}  // namespace isomatch
